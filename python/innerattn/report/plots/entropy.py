"""Fig. 4: the entropy of attention during training, with the band over runs; it measures nothing.

Above, each method's mean over robots and heads, below the robots and heads of every method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.report.plots.drawing import (
    BLUE,
    COLUMN_WIDTH_IN,
    GREEN,
    PAGE_WIDTH_IN,
    PURPLE,
    ROBOT_COLOURS,
    VERMILION,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_METHODS = ((BLUE, "-"), (VERMILION, "--"), (GREEN, "-."), (PURPLE, ":"))


@dataclass(frozen=True)
class EntropyLines:
    """What is drawn of one situation and method.

    Attributes:
        situation: of the worlds.
        method: of training.
        label: for the legend, with the number of runs and what the band is.
        env_steps: (T,) [env-steps].
        mean: (3, T) mean over robots and heads, low and high end of the band; NaN for no band.
        robots: R names.
        by_robot: (3, T, R) mean over heads, low and high end of the band; NaN for no band.
        by_head: (T, R, H) mean over runs.
        even_nats: ln(R - 1).
    """

    situation: str
    method: str
    label: str
    env_steps: NDArray[np.int64]
    mean: Array
    robots: tuple[str, ...]
    by_robot: Array
    by_head: Array
    even_nats: float


def draw_entropy(lines: Sequence[EntropyLines], printed_nats: float) -> Figure:
    """A column for each situation, a row for all methods and one for each.

    Args:
        lines: at least one.
        printed_nats: the paper's value, drawn for comparison.
    """
    from matplotlib.figure import Figure

    situations = list(dict.fromkeys(line.situation for line in lines))
    methods = list(dict.fromkeys(line.method for line in lines))
    width = PAGE_WIDTH_IN if len(situations) > 1 else COLUMN_WIDTH_IN
    figure = Figure(figsize=(width, 0.3 + 2.4 * (1 + len(methods))), layout="constrained")
    panels = figure.subplots(1 + len(methods), len(situations), sharey=True, squeeze=False)
    robots: dict[str, Artist] = {}
    for column, situation in enumerate(situations):
        own = {line.method: line for line in lines if line.situation == situation}
        upper, *lower = panels[:, column]
        for method, panel in zip(methods, lower, strict=True):
            if method not in own:
                panel.set_axis_off()
                continue
            _method(upper, own[method], *_METHODS[methods.index(method) % len(_METHODS)])
            robots |= _robots(panel, own[method])
            panel.set_title(f"{method} by robot; thin: its heads", fontsize=7)
        upper.set_title(situation, fontsize=9)
        upper.legend(fontsize=6, loc="lower right", frameon=False)
        even = next(iter(own.values())).even_nats
        for panel in (panel for panel in (upper, *lower) if panel.axison):
            panel.set_xlabel("training [1,000 env-steps]", fontsize=8)
            _marks(panel, even, printed_nats)
            _teammates(panel, labelled=column == len(situations) - 1)
    for panel in panels[:, 0]:
        panel.set_ylabel("entropy of attention [nats]", fontsize=8)
    figure.legend(
        robots.values(),
        robots.keys(),
        fontsize=7,
        ncols=round(width / 1.7),
        loc="outside lower center",
        frameon=False,
    )
    least = min(float(np.nanmin([line.mean.min(), line.by_head.min()])) for line in lines)
    panels[0, 0].set_ylim(max(0.0, least - 0.1), 1.06 * max(line.even_nats for line in lines))
    return figure


def _method(panel: Axes, line: EntropyLines, colour: str, style: str) -> None:
    steps = line.env_steps / 1000.0
    mean, low, high = line.mean
    panel.plot(steps, mean, style, color=colour, linewidth=1.4, label=line.label)
    if np.isfinite(low).any():
        panel.fill_between(steps, low, high, color=colour, alpha=0.2, linewidth=0.0)


def _robots(panel: Axes, line: EntropyLines) -> dict[str, Artist]:
    """Draw them; their lines by name, for the legend."""
    drawn: dict[str, Artist] = {}
    steps = line.env_steps / 1000.0
    for r, robot in enumerate(line.robots):
        colour = ROBOT_COLOURS[r % len(ROBOT_COLOURS)]
        panel.plot(steps, line.by_head[:, r], color=colour, linewidth=0.5, alpha=0.45)
        mean, low, high = line.by_robot[:, :, r]
        (drawn[robot],) = panel.plot(steps, mean, color=colour, linewidth=1.5)
        if np.isfinite(low).any():
            panel.fill_between(steps, low, high, color=colour, alpha=0.15, linewidth=0.0)
    return drawn


def _marks(panel: Axes, even_nats: float, printed_nats: float) -> None:
    """Lines for even attention and for the paper's value, named at the left."""
    panel.axhline(even_nats, color="black", linewidth=0.9)
    panel.axhline(printed_nats, color="black", linewidth=0.9, linestyle=":")
    panel.tick_params(labelsize=7, length=2)
    for nats, name, side in (
        (even_nats, f"uniform: {even_nats:.2f}", "bottom"),
        (printed_nats, f"paper: {printed_nats:.2f}", "top"),
    ):
        panel.annotate(
            name,
            (0.02, nats),
            xycoords=("axes fraction", "data"),
            xytext=(0, 1 if side == "bottom" else -1),
            textcoords="offset points",
            fontsize=6,
            va=side,
        )


def _teammates(panel: Axes, *, labelled: bool) -> None:
    """An axis on the right: exp(entropy), how many teammates are attended to in effect."""
    from matplotlib.ticker import MaxNLocator

    axis = panel.secondary_yaxis("right", functions=(_exp, _log))
    axis.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    axis.tick_params(labelsize=7 if labelled else 0, length=2, labelright=labelled)
    if labelled:
        axis.set_ylabel("exp(entropy) [teammates]", fontsize=8)


def _exp(values: ArrayLike) -> Array:
    return np.exp(np.asarray(values, np.float64))


def _log(values: ArrayLike) -> Array:
    return np.log(np.maximum(np.asarray(values, np.float64), 1e-9))
