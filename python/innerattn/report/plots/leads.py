"""How much more actors attend to the next partner than to the last one, around handoffs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from innerattn.report.plots.drawing import (
    BLACK,
    BLUE,
    PAGE_WIDTH_IN,
    VERMILION,
    legend_below,
    runs_and_band,
)
from innerattn.studies.actor_attention import LeadCurves

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WHO = (("robot that hands over", BLUE, "-"), ("bystander", VERMILION, "--"))


def draw_leads(found: Mapping[str, LeadCurves]) -> Figure:
    """A panel for each place in the grid, by its name; at least one."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH_IN, 2.9), layout="constrained")
    panels = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    handles: dict[str, Any] = {}
    for panel, (name, curves) in zip(panels, found.items(), strict=True):
        handles |= _leads(panel, curves)
        runs = runs_and_band(curves.runs, curves.robot)
        panel.set_title(f"{name}\n{runs}, {curves.handoffs:,} handoffs", fontsize=7)
    panels[0].set_ylabel("weight on the next partner − on the last", fontsize=7)
    legend_below(figure, handles)
    return figure


def _leads(panel: Axes, curves: LeadCurves) -> dict[str, Any]:
    """One panel; what a legend shows."""
    from matplotlib.ticker import MaxNLocator

    handles: dict[str, Any] = {}
    both = curves.robot, curves.bystander
    for (name, colour, style), curve in zip(_WHO, both, strict=True):
        (handles[name],) = panel.plot(
            curves.offsets, curve.mean, style, color=colour, linewidth=1.3
        )
        if np.isfinite(curve.low).any():
            band = curves.offsets, curve.low, curve.high
            panel.fill_between(*band, color=colour, alpha=0.2, linewidth=0)
    panel.axhline(0.0, color=BLACK, linewidth=0.7, linestyle=":")
    panel.axvline(0.5, color=BLACK, linewidth=0.9)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.tick_params(labelsize=7)
    panel.set_xlabel(f"steps since the first rescue [{curves.step_s:g} s]", fontsize=7)
    return handles
