"""Scores of the trials of a search against what they cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from innerattn.report.plots.drawing import (
    BLACK,
    BLUE,
    COLUMN_WIDTH_IN,
    ORANGE,
    labelled,
    legend_below,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class TrialDot:
    """A trial.

    Attributes:
        core_s: what all trials until then, it included, have cost [core-seconds].
        mean: of its score.
        finished: whether it has all seeds.
    """

    core_s: float
    mean: float
    finished: bool


def draw_search(dots: Sequence[TrialDot], recipe: float | None, label: str, most: bool) -> Figure:
    """A dot for each trial, and the best mean so far.

    Args:
        dots: in the order of the proposals, at least one.
        recipe: mean of the grid without changes; None if there is none.
        label: what the values are.
        most: whether larger values are better.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(COLUMN_WIDTH_IN, 2.4), layout="constrained")
    panel = figure.subplots()
    for finished, colour, marker, name in (
        (True, BLUE, "o", "all seeds"),
        (False, ORANGE, "x", "fewer seeds"),
    ):
        own = [one for one in dots if one.finished == finished]
        if own:
            times = [one.core_s / 60.0 for one in own]
            means = [one.mean for one in own]
            panel.plot(times, means, marker, color=colour, markersize=4, label=name)
    best: list[tuple[float, float]] = []
    better = max if most else min
    for one in dots:
        if one.finished:
            best.append((one.core_s / 60.0, better([one.mean, *(mean for _, mean in best[-1:])])))
    if best:
        panel.step(*zip(*best, strict=True), where="post", color=BLUE, linewidth=1.2, label="best")
    if recipe is not None:
        panel.axhline(recipe, color=BLACK, linewidth=0.8, linestyle=(0, (1, 1)), label="recipe")
    panel.set_xlim(left=0.0)
    panel.set_xlabel("training of all trials [core-minutes]", fontsize=8)
    panel.set_ylabel(label, fontsize=8)
    panel.tick_params(labelsize=7, length=2)
    legend_below(figure, labelled(panel))
    return figure
