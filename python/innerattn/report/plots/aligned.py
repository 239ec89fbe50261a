"""Fig. 5's evidence: attention around handoffs, of who hands over and of the bystander."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from innerattn.report.plots.drawing import BLACK, BLUE, COLUMN_WIDTH_IN, PAGE_WIDTH_IN, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class AlignedLines:
    """What is drawn of all handoffs of one situation and method; W offsets.

    Attributes:
        situation: of the worlds.
        method: of training.
        runs: what they are over: numbers of runs and handoffs, and what the bands are.
        offsets: (W,) steps since the first rescue's.
        step_s: length of a step [s].
        even: weight of even attention.
        robot: by partner (next, last) (2, 3, W): mean, low and high; NaN for no band.
        control: the same of the bystander.
    """

    situation: str
    method: str
    runs: str
    offsets: NDArray[np.int64]
    step_s: float
    even: float
    robot: NDArray[np.float64]
    control: NDArray[np.float64]


def draw_aligned(lines: Sequence[AlignedLines]) -> Figure:
    """A row for each method and a column for each situation; at least one line."""
    from matplotlib.figure import Figure

    methods = list(dict.fromkeys(line.method for line in lines))
    situations = list(dict.fromkeys(line.situation for line in lines))
    wide = len(situations) > 1
    size = (PAGE_WIDTH_IN if wide else COLUMN_WIDTH_IN, 0.9 + 2.3 * len(methods))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(methods), len(situations), sharey=True, squeeze=False)
    handles: dict[str, Any] = {}
    for row, method in enumerate(methods):
        for column, situation in enumerate(situations):
            panel = panels[row, column]
            own = [x for x in lines if (x.method, x.situation) == (method, situation)]
            if not own:
                panel.set_axis_off()
                continue
            handles |= _aligned(panel, own[0])
            panel.set_title(f"{situation}, {method}\n{own[0].runs}", fontsize=7)
            panel.set_xlabel(f"steps since the first rescue [{own[0].step_s:g} s]", fontsize=7)
        panels[row, 0].set_ylabel("weight, mean over heads", fontsize=8)
    where: dict[str, Any] = {"loc": "outside lower center", "ncols": 2 if wide else 1}
    figure.legend(handles.values(), handles.keys(), fontsize=7, frameon=False, **where)
    return figure


def _aligned(panel: Axes, line: AlignedLines) -> dict[str, Any]:
    """One panel; what a legend shows."""
    from matplotlib.ticker import MaxNLocator

    handles: dict[str, Any] = {}
    partners = (("the next partner", BLUE), ("the last partner", VERMILION))
    who = (
        ("robot that hands over", "-", 0.25, line.robot),
        ("bystander", "--", 0.1, line.control),
    )
    for name, style, alpha, courses in who:
        for (partner, colour), (mean, low, high) in zip(partners, courses, strict=True):
            drawn = panel.plot(line.offsets, mean, style, color=colour, linewidth=1.3)
            handles[f"{name}: weight on {partner}"] = drawn[0]
            if np.isfinite(low).any():
                panel.fill_between(line.offsets, low, high, color=colour, alpha=alpha, linewidth=0)
    panel.axhline(line.even, color=BLACK, linewidth=0.7, linestyle=":")
    panel.axvline(0.5, color=BLACK, linewidth=0.9)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.tick_params(labelsize=7, length=2)
    return handles
