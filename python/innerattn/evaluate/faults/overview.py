"""Retention and attention under faults, in the few numbers that tables show."""

from __future__ import annotations

from dataclasses import dataclass

from innerattn.evaluate.faults.document import worst_robot
from innerattn.evaluate.faults.grid import Grid, Retention
from innerattn.measures.faults.shift_results import KindShift
from innerattn.stats import Estimate


@dataclass(frozen=True)
class KindOverview:
    """What a policy retains under one kind of fault.

    Attributes:
        kind: of the fault.
        rescues: per episode with a fault from the start, mean over severities and robots.
        retention: mean over severities, robots and onsets.
        by_severity: of a fault from the start, mean over robots; NaN where there is none.
        worst_robot: the robot whose worst fault costs most.
        worst: retention with that robot at the last severity.
        early: in the first half of what follows an onset in the middle.
        late: in the second half.
        change: late minus early.
    """

    kind: str
    rescues: Estimate
    retention: Estimate
    by_severity: tuple[float, ...]
    worst_robot: str
    worst: Estimate
    early: Estimate
    late: Estimate
    change: Estimate


@dataclass(frozen=True)
class Overview:
    """What a policy retains.

    Attributes:
        rescues: per episode, without a fault.
        rescues_with_fault: per episode with a fault from the start, mean over the kinds.
        kinds: by kind of fault.
        retention: mean over the kinds.
    """

    rescues: Estimate
    rescues_with_fault: Estimate
    kinds: tuple[KindOverview, ...]
    retention: Estimate


def overview(grid: Grid, retained: Retention) -> Overview:
    """The numbers of one policy."""
    areas = retained.by_kind()
    rescues = retained.rescues_by_kind
    early, late = (part.retention.mean((1, 2)) for part in (retained.early, retained.late))
    kinds = []
    for k, kind in enumerate(grid.kinds):
        robot, worst = worst_robot(grid, retained, k)
        kinds.append(
            KindOverview(
                kind=kind,
                rescues=rescues[k].estimate(),
                retention=areas[k].estimate(),
                by_severity=tuple(retained.cells.value[k, :, :, 0].mean(1).tolist()),
                worst_robot=robot,
                worst=worst,
                early=early[k].estimate(),
                late=late[k].estimate(),
                change=(late[k] - early[k]).estimate(),
            )
        )
    return Overview(
        rescues=retained.clean.estimate(),
        rescues_with_fault=rescues.mean(0).estimate(),
        kinds=tuple(kinds),
        retention=areas.mean(0).estimate(),
    )


def weight_without_fault(shift_of_kind: KindShift) -> float:
    """Mean weight on a robot at the steps of its fault, in the same worlds without the fault."""
    weights = [shift.after.mean.mean - shift.effect.mean.mean for shift in shift_of_kind.robots]
    return sum(weights) / len(weights)
