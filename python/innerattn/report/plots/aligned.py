"""Fig. 5's evidence: attention around handoffs, of who hands over and of the bystander."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from innerattn.experiments.paper.fig5 import ROLES, Evidence
from innerattn.report.plots.drawing import (
    BLACK,
    BLUE,
    VERMILION,
    legend_below,
    method_panels,
    runs_and_band,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PARTNERS = (("the next partner", BLUE), ("the last partner", VERMILION))
"""Names and colours of the partners in `ROLES`."""


def draw_aligned(found: Sequence[Evidence]) -> Figure:
    """A row for each method and a column for each situation; at least one."""
    figure, _, handles = method_panels(found, 0.9, "weight, mean over heads", _aligned)
    legend_below(figure, handles, 2 if len({part.situation for part in found}) > 1 else 1)
    return figure


def _aligned(panel: Axes, part: Evidence) -> dict[str, Any]:
    """One panel; what a legend shows."""
    from matplotlib.ticker import MaxNLocator

    handles: dict[str, Any] = {}
    who = (("robot that hands over", "-", 0.25, part.robot), ("bystander", "--", 0.1, part.control))
    for name, style, alpha, evidence in who:
        for role, (partner, colour) in zip(ROLES, _PARTNERS, strict=True):
            curve = evidence[role].weight
            drawn = panel.plot(part.offsets, curve.mean, style, color=colour, linewidth=1.3)
            handles[f"{name}: weight on {partner}"] = drawn[0]
            if np.isfinite(curve.low).any():
                band = part.offsets, curve.low, curve.high
                panel.fill_between(*band, color=colour, alpha=alpha, linewidth=0)
    panel.axhline(part.even, color=BLACK, linewidth=0.7, linestyle=":")
    panel.axvline(0.5, color=BLACK, linewidth=0.9)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    runs = runs_and_band(part.runs, part.robot["to_be"].weight)
    title = f"{part.situation}, {part.method}\n{runs}, {sum(part.handoffs):,} handoffs"
    panel.set_title(title, fontsize=7)
    panel.set_xlabel(f"steps since the first rescue [{part.step_s:g} s]", fontsize=7)
    return handles
