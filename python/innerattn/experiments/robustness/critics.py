"""What disturbances and faults do to attention, over the critics of a study."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.experiments.robustness.documents import (
    AttentionShift,
    BoundLevel,
    GroupResult,
    over_seeds,
)
from innerattn.stats import Estimate


@dataclass(frozen=True)
class BoundsOverRuns:
    """The bounds on attention, over critics.

    Attributes:
        critics: how many with inner attention; others have no logits.
        runs: how many in all.
        checks: of all inequalities.
        violations: among these.
        levels: means of medians, and largest values, over critics.
    """

    critics: int
    runs: int
    checks: int
    violations: int
    levels: tuple[BoundLevel, ...]


@dataclass(frozen=True)
class ShiftOverRuns:
    """What the worst fault of a kind does to the weight on the robot that has it, over seeds.

    Attributes:
        effect: on the mean weight.
        auc: how well the weight tells that the robot is faulty.
        by_robot: least and largest effect on any robot of any run.
    """

    effect: Estimate | None
    auc: Estimate | None
    by_robot: tuple[float, float]


def bounds_over_runs(found: Sequence[GroupResult]) -> BoundsOverRuns | None:
    """The bounds on the critics of groups; None where none has inner attention."""
    checked = [bounds for group in found for bounds in group.bounds.values()]
    if not checked:
        return None
    levels = []
    for same in zip(*(bounds.levels for bounds in checked), strict=True):
        flips = [level.actor_flips for level in same if level.actor_flips is not None]
        levels.append(
            BoundLevel(
                same[0].changed,
                same[0].direction,
                same[0].radius,
                _middle_and_largest([level.logit for level in same]),
                _middle_and_largest([level.weight for level in same]),
                _middle_and_largest([level.values for level in same]),
                statistics.mean(flips) if flips else None,
            )
        )
    return BoundsOverRuns(
        critics=len(checked),
        runs=sum(group.critics for group in found),
        checks=sum(bounds.checks for bounds in checked),
        violations=sum(bounds.violations for bounds in checked),
        levels=tuple(levels),
    )


def _middle_and_largest(values: Sequence[tuple[float, float]]) -> tuple[float, float]:
    return statistics.mean(median for median, _ in values), max(largest for _, largest in values)


def shifts_over_runs(found: Sequence[GroupResult]) -> dict[str, dict[str, ShiftOverRuns]]:
    """What faults do to the attention of groups, by method with inner attention, then by kind."""
    own: dict[str, list[dict[str, AttentionShift]]] = {}
    for group in found:
        for case, shifts in group.attention.items():
            own.setdefault(case.method, []).append(shifts)
    return {
        method: {kind: _shift([shifts[kind] for shifts in runs]) for kind in runs[0]}
        for method, runs in own.items()
    }


def _shift(runs: Sequence[AttentionShift]) -> ShiftOverRuns:
    each = [effect for shift in runs for effect in shift.by_robot]
    return ShiftOverRuns(
        effect=over_seeds([shift.effect for shift in runs]),
        auc=over_seeds([shift.auc for shift in runs]),
        by_robot=(min(each), max(each)),
    )
