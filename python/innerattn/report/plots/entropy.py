"""Fig. 4: the entropy of attention during training; it measures nothing.

A panel has one band, of the mean over robots and heads, one line for each robot, and at its right
edge a dot for each head at the end of training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.envs.colours import robot_looks
from innerattn.report.plots.drawing import BLACK, COLUMN_WIDTH_IN, PAGE_WIDTH_IN, TWIN_DASHES

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_GREY = "#C8C8C8"
_HEADS = 0.24  # width of the strip of heads, in lengths of the training


@dataclass(frozen=True)
class EntropyLines:
    """What is drawn of one situation and method.

    Attributes:
        situation: of the worlds.
        method: of training.
        runs: how many there are, and what the band is.
        env_steps: (T,) [env-steps].
        mean: (3, T) mean over robots and heads, low and high end of the band; NaN for no band.
        robots: R names.
        kinds: of the R robots; twins of a kind have its colour and another dash.
        by_robot: (T, R) mean over heads.
        heads: (N, R, H) of each run's own heads, at the end.
        even_nats: ln(R - 1).
    """

    situation: str
    method: str
    runs: str
    env_steps: NDArray[np.int64]
    mean: Array
    robots: tuple[str, ...]
    kinds: tuple[str, ...]
    by_robot: Array
    heads: Array
    even_nats: float


def draw_entropy(lines: Sequence[EntropyLines], printed_nats: float) -> Figure:
    """A row for each method and a column for each situation.

    Args:
        lines: at least one.
        printed_nats: the paper's value, drawn for comparison.
    """
    from matplotlib.figure import Figure

    situations = list(dict.fromkeys(line.situation for line in lines))
    methods = list(dict.fromkeys(line.method for line in lines))
    width = PAGE_WIDTH_IN if len(situations) > 1 else COLUMN_WIDTH_IN
    figure = Figure(figsize=(width, 0.5 + 2.3 * len(methods)), layout="constrained")
    panels = figure.subplots(len(methods), len(situations), sharey=True, squeeze=False)
    handles: dict[str, Artist] = {}
    for row, method in enumerate(methods):
        for column, situation in enumerate(situations):
            panel = panels[row, column]
            own = [x for x in lines if (x.method, x.situation) == (method, situation)]
            if not own:
                panel.set_axis_off()
                continue
            handles |= _course(panel, own[0])
            _heads(panel, own[0])
            _marks(panel, own[0].even_nats, printed_nats)
            _teammates(panel, labelled=column == len(situations) - 1)
            panel.set_title(f"{situation}, {method}\n{own[0].runs}", fontsize=7)
            panel.set_xlabel("training [1,000 env-steps]", fontsize=7)
        panels[row, 0].set_ylabel("entropy of attention [nats]", fontsize=8)
    figure.legend(
        handles.values(),
        handles.keys(),
        fontsize=7,
        ncols=len(handles) if len(situations) > 1 else 2,
        loc="outside lower center",
        frameon=False,
    )
    drawn = [x for line in lines for x in (line.mean[0], line.by_robot, line.heads)]
    least = min(printed_nats, *(float(x.min()) for x in drawn if x.size))
    panels[0, 0].set_ylim(max(0.0, least - 0.05), 1.06 * max(line.even_nats for line in lines))
    return figure


def _course(panel: Axes, line: EntropyLines) -> dict[str, Artist]:
    """Draw the courses; what a legend shows."""
    handles: dict[str, Artist] = {}
    steps = line.env_steps / 1000.0
    mean, low, high = line.mean
    if np.isfinite(low).any():
        panel.fill_between(steps, low, high, color=_GREY, linewidth=0.0)
    for r, (robot, look) in enumerate(zip(line.robots, robot_looks(line.kinds), strict=True)):
        dash = TWIN_DASHES[look.twin % len(TWIN_DASHES)]
        (handles[robot],) = panel.plot(
            steps, line.by_robot[:, r], dash, color=look.colour, linewidth=0.8
        )
    (handles["mean over robots"],) = panel.plot(steps, mean, color=BLACK, linewidth=1.3)
    return handles


def _heads(panel: Axes, line: EntropyLines) -> None:
    """A strip beside the courses: the heads of each robot in a column of their own."""
    from matplotlib.ticker import MaxNLocator

    last = float(line.env_steps[-1]) / 1000.0
    strip = _HEADS * last
    places = last + strip * (np.arange(len(line.robots)) + 1.0) / (len(line.robots) + 0.5)
    for r, (place, look) in enumerate(zip(places, robot_looks(line.kinds), strict=True)):
        values = line.heads[:, r].ravel()
        panel.plot(
            np.full(len(values), place),
            values,
            "o",
            color=look.colour,
            markersize=2.2,
            markeredgewidth=0.0,
            alpha=0.6,
        )
    panel.axvline(last + 0.03 * strip, color=_GREY, linewidth=0.7)
    panel.annotate(
        "heads",
        (last + 0.55 * strip, 0.02),
        xycoords=("data", "axes fraction"),
        fontsize=6,
        ha="center",
    )
    ticks = MaxNLocator(nbins=4, steps=[1, 2, 5, 10]).tick_values(0.0, last)
    panel.set_xticks([tick for tick in ticks if 0.0 <= tick <= 1.001 * last])
    panel.set_xlim(-0.03 * last, last + 1.08 * strip)


def _marks(panel: Axes, even_nats: float, printed_nats: float) -> None:
    """Lines for even attention and for the paper's value, named at the left."""
    panel.tick_params(labelsize=7, length=2)
    for nats, name, style, up in (
        (even_nats, f"uniform {even_nats:.2f}", "-", 1),
        (printed_nats, f"paper {printed_nats:.2f}", ":", -1),
    ):
        panel.axhline(nats, color=BLACK, linewidth=0.8, linestyle=style)
        panel.annotate(
            name,
            (0.02, nats),
            xycoords=("axes fraction", "data"),
            xytext=(0, up),
            textcoords="offset points",
            fontsize=6,
            va="bottom" if up > 0 else "top",
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
