"""The runs of several arms, a dot each, with their means; it measures nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from innerattn.report.plots.drawing import BLACK, BLUE, PAGE_WIDTH_IN, VERMILION
from innerattn.stats import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ArmDots:
    """What is drawn of one arm in one panel.

    Attributes:
        name: of the arm.
        inner: whether its attention is learnt.
        values: one of each run.
        mean: over runs; None for no bar.
    """

    name: str
    inner: bool
    values: tuple[float, ...]
    mean: Estimate | None


@dataclass(frozen=True)
class ArmPanel:
    """One result of the runs in one situation.

    Attributes:
        situation: of the worlds.
        label: what is drawn, with its unit.
        arms: from top to bottom.
        marks: values at which a line is drawn.
        limits: least and largest possible value; an interval is cut off there. None: as wide as
            needed.
    """

    situation: str
    label: str
    arms: tuple[ArmDots, ...]
    marks: tuple[float, ...] = ()
    limits: tuple[float, float] | None = None


def draw_arms(rows: Sequence[Sequence[ArmPanel]]) -> Figure:
    """A row of panels for each situation, arms named at the left.

    Args:
        rows: at least one row; all have the same figures, those of a row the same arms.
    """
    from matplotlib.figure import Figure

    heights = [0.55 + 0.2 * len(row[0].arms) for row in rows]
    figure = Figure(figsize=(PAGE_WIDTH_IN, 0.7 + sum(heights)), layout="constrained")
    panels = figure.subplots(
        len(rows), len(rows[0]), sharey="row", sharex="col", squeeze=False, height_ratios=heights
    )
    for row, drawn in enumerate(rows):
        for column, part in enumerate(drawn):
            _panel(panels[row, column], part)
        names = [arm.name for arm in drawn[0].arms]
        panels[row, 0].set_yticks(range(len(names)), names, fontsize=7)
        panels[row, 0].set_ylim(len(names) - 0.4, -0.6)
        panels[row, 0].set_title(drawn[0].situation, fontsize=9, loc="left")
    for column, part in enumerate(rows[-1]):
        panels[-1, column].set_xlabel(part.label, fontsize=7)
        if part.limits is not None:
            low, high = part.limits
            margin = 0.05 * (high - low)
            panels[-1, column].set_xlim(low - margin, high + margin)
    return figure


def _panel(panel: Axes, part: ArmPanel) -> None:
    for mark in part.marks:
        panel.axvline(mark, color=BLACK, linewidth=0.7, linestyle=":")
    for y, arm in enumerate(part.arms):
        colour, marker = (BLUE, "o") if arm.inner else (VERMILION, "s")
        # Runs of an arm lie a little apart, in their order, so that equal values stay visible.
        offsets = np.linspace(-0.18, 0.18, len(arm.values)) if len(arm.values) > 1 else [0.0]
        heights = y + np.asarray(offsets)[: len(arm.values)]
        panel.plot(
            arm.values, heights, marker, color=colour, markersize=2.6, alpha=0.7, linewidth=0.0
        )
        if arm.mean is not None:
            ends = [arm.mean.low, arm.mean.high]
            panel.plot(ends, [y + 0.34] * 2, color=colour, linewidth=1.6)
            panel.plot(
                [arm.mean.mean], [y + 0.34], "|", color=colour, markersize=6, markeredgewidth=1.6
            )
    panel.grid(axis="y", linewidth=0.3)
    panel.tick_params(labelsize=7, length=2)
