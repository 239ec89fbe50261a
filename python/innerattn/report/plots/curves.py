"""Learning curves: rescues against env-steps and time, beside scripts; it measures nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from innerattn.report.plots.drawing import (
    BLACK,
    BLUE,
    COLUMN_WIDTH_IN,
    GREEN,
    ORANGE,
    PAGE_WIDTH_IN,
    PURPLE,
    SKY,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_STYLES = ((BLUE, "-"), (ORANGE, "--"), (PURPLE, "-."), (GREEN, ":"), (SKY, "-"))


@dataclass(frozen=True)
class CurveLine:
    """What is drawn of one situation and method.

    Attributes:
        situation: of the worlds.
        method: of training.
        env_steps: (T,) [env-steps].
        seconds: (T,) [s] of training.
        rescues: (3, T) mean, low and high end of the band; NaN for no band.
        scripts: rescues of scripts by name; those of a panel's first line are drawn.
    """

    situation: str
    method: str
    env_steps: Array
    seconds: Array
    rescues: Array
    scripts: dict[str, float]


def draw_curves(lines: Sequence[CurveLine], label: str) -> Figure:
    """Panels for each situation, above against env-steps and below against time.

    Args:
        lines: at least one, of up to five methods.
        label: what the values are.
    """
    from matplotlib.figure import Figure

    situations = list(dict.fromkeys(line.situation for line in lines))
    methods = list(dict.fromkeys(line.method for line in lines))
    width = PAGE_WIDTH_IN if len(situations) > 1 else COLUMN_WIDTH_IN
    figure = Figure(figsize=(width, 4.8), layout="constrained")
    rows = figure.subplots(2, len(situations), squeeze=False, sharey="col")
    for (above, below), situation in zip(rows.T, situations, strict=True):
        own = [line for line in lines if line.situation == situation]
        for line in own:
            style = _STYLES[methods.index(line.method) % len(_STYLES)]
            _line(above, line.env_steps / 1000.0, line, *style)
            _line(below, line.seconds / 60.0, line, *style)
        above.set_title(situation, fontsize=9)
        above.set_xlabel("training [1,000 env-steps]", fontsize=8)
        below.set_xlabel("training [min]", fontsize=8)
        for panel in (above, below):
            _scripts(panel, own[0].scripts)
            panel.tick_params(labelsize=7, length=2)
        above.set_ylim(0.0, 1.06 * above.get_ylim()[1])
    for panel in rows[:, 0]:
        panel.set_ylabel(label, fontsize=8)
    handles, names = rows[0, 0].get_legend_handles_labels()
    figure.legend(
        handles, names, fontsize=7, ncols=len(names), loc="outside lower center", frameon=False
    )
    return figure


def _line(panel: Axes, times: Array, line: CurveLine, colour: str, style: str) -> None:
    mean, low, high = line.rescues
    panel.plot(times, mean, style, color=colour, linewidth=1.4, label=line.method)
    panel.fill_between(times, low, high, color=colour, alpha=0.2, linewidth=0.0)


def _scripts(panel: Axes, heights: dict[str, float]) -> None:
    """Lines at what scripts rescue, named at the left."""
    for name, height in heights.items():
        panel.axhline(height, color=BLACK, linewidth=0.8, linestyle=(0, (1, 1)))
        panel.annotate(
            name,
            (0.02, height),
            xycoords=("axes fraction", "data"),
            xytext=(0, 1),
            textcoords="offset points",
            fontsize=6,
            va="bottom",
        )
