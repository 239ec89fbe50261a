"""Fig. 5's evidence over many runs: attention around all handoffs, and a control.

A handoff is one robot's rescue with one partner and its next with another; the handoffs of both
robots that share an ability, in both orders of the tasks, are taken together. The control is the
other of these robots at the same steps. What its attention does too follows from the victims that
are there, not from who hands over.

A control that rescues somebody itself has work of its own to attend to, so that the difference of
the two says little. Only handoffs count in whose window the control takes part in no rescue, and
the difference is shown beside its ceiling: what it is in the same windows if every robot attends to
the partner of its own next rescue alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.experiments.run import FinishedRun, OfMethod
from innerattn.measures.sharing.handoff import (
    all_handoffs,
    need_following_attention,
    rescues_nobody,
    with_control,
)
from innerattn.measures.sharing.handoff_attention import (
    Attended,
    HandoffAttention,
    handoff_attention,
)
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.estimate import as_json
from innerattn.stats.seeds import Array, SeedCurve, seed_curve, seed_estimate

SCHEMA_VERSION = 3

ROLES = ("to_be", "before")
"""The partner of the second rescue, and that of the first."""

_EVEN_WITHIN = 1e-5
_SEED = 0  # of the permutations


@dataclass(frozen=True)
class RoleEvidence:
    """The weight on the partner in one role, averaged over heads; N runs, W offsets.

    Attributes:
        weight: over runs, by offset (W,); each run is a mean over its own handoffs.
        change: over runs, mean weight after the first rescue minus that up to it.
        change_by_run: (N,) None for a run without handoffs.
    """

    weight: SeedCurve
    change: Estimate | None
    change_by_run: tuple[float | None, ...]


@dataclass(frozen=True)
class Evidence(OfMethod):
    """Attention around the handoffs of one situation and method; N runs.

    Attributes:
        handoffs: (N,) how many in whose window the control rescues nobody.
        left_out: (N,) how many in whose window the control takes part in a rescue.
        episodes: (N,) how many episodes the handoffs come from, of those recorded step by step.
        offsets: (W,) int64 steps since the first rescue's; those above 0 are after it.
        step_s: length of a step [s].
        even: 1 / (R - 1), the weight of even attention.
        robot: by role, of the robot that hands over.
        control: by role, of the control, with the same partners.
        own_part: over runs, the change on the partner-to-be of the robot minus the control's.
        own_part_by_run: (N,) None for a run without handoffs.
        ceiling: over runs, ``own_part`` of attention that follows each robot's own next rescue.
        own_part_beyond_half: over runs, that part minus half the robot's change.
        p_by_run: (N,) of the permutation test, see `handoff_attention`; None for a run without
            handoffs.
        control_p_by_run: (N,) the same of the control.
    """

    handoffs: tuple[int, ...]
    left_out: tuple[int, ...]
    episodes: tuple[int, ...]
    offsets: NDArray[np.int64]
    step_s: float
    even: float
    robot: dict[str, RoleEvidence]
    control: dict[str, RoleEvidence]
    own_part: Estimate | None
    own_part_by_run: tuple[float | None, ...]
    ceiling: Estimate | None
    own_part_beyond_half: Estimate | None
    p_by_run: tuple[float | None, ...]
    control_p_by_run: tuple[float | None, ...]

    @property
    def runs(self) -> int:
        """How many runs have handoffs."""
        return sum(number > 0 for number in self.handoffs)


class _Run(NamedTuple):
    """Attention around one run's handoffs; None where there are none."""

    robot: HandoffAttention | None
    control: HandoffAttention | None
    ceiling: float | None
    left_out: int


def evidence(group: Sequence[FinishedRun]) -> Evidence | None:
    """Attention around handoffs in runs of one situation and method.

    Returns:
        None where no run has handoffs and attention that chooses, rather than being even.
    """
    first = group[0].recorded
    if not any(_chooses(measured.recorded) for measured in group):
        return None
    runs = [_of_run(measured.recorded) for measured in group]
    known = [run.robot for run in runs if run.robot is not None]
    if not known:
        return None
    robot = {role: _role([run.robot for run in runs], role) for role in ROLES}
    control = {role: _role([run.control for run in runs], role) for role in ROLES}
    changes = zip(robot["to_be"].change_by_run, control["to_be"].change_by_run, strict=True)
    pairs = [None if one is None or other is None else (one, other) for one, other in changes]
    own = tuple(None if pair is None else pair[0] - pair[1] for pair in pairs)
    beyond_half = tuple(None if pair is None else 0.5 * pair[0] - pair[1] for pair in pairs)
    return Evidence(
        situation=group[0].situation,
        method=group[0].method,
        seeds=tuple(measured.seed for measured in group),
        handoffs=tuple(run.robot.handoffs if run.robot else 0 for run in runs),
        left_out=tuple(run.left_out for run in runs),
        episodes=tuple(run.robot.episodes if run.robot else 0 for run in runs),
        offsets=known[0].offsets,
        step_s=first.scenario.dt_s,
        even=1.0 / (first.scenario.num_robots - 1),
        robot=robot,
        control=control,
        own_part=seed_estimate(own),
        own_part_by_run=own,
        ceiling=seed_estimate([run.ceiling for run in runs]),
        own_part_beyond_half=seed_estimate(beyond_half),
        p_by_run=tuple(run.robot.p if run.robot else None for run in runs),
        control_p_by_run=tuple(run.control.p if run.control else None for run in runs),
    )


def _of_run(record: Record) -> _Run:
    """The handoffs of a record in whose window the control rescues nobody."""
    events = all_handoffs(record)
    control = with_control(record, events)
    idle = rescues_nobody(record, control)
    left_out = int((~idle).sum())
    events, control = events[idle], control[idle]
    follows = replace(record, steps={"attention": need_following_attention(record)})
    changes = [
        float(around.to_be.change[0, 0])
        for around in (handoff_attention(follows, rows, _SEED) for rows in (events, control))
        if around is not None
    ]
    return _Run(
        handoff_attention(record, events, _SEED),
        handoff_attention(record, control, _SEED),
        changes[0] - changes[1] if changes else None,
        left_out,
    )


def evidence_json(parts: Sequence[Evidence]) -> dict[str, Any]:
    """The document of ``fig5_evidence.json``."""
    return {"schema_version": SCHEMA_VERSION, "evidence": as_json(parts)}


def _chooses(record: Record) -> bool:
    """Whether attention is ever more than even."""
    even = 1.0 / max(record.scenario.num_robots - 1, 1)
    weights = record.steps.get("attention")
    return weights is not None and bool((weights > even + _EVEN_WITHIN).any())


def _role(runs: Sequence[HandoffAttention | None], role: str) -> RoleEvidence:
    parts: list[Attended | None] = [getattr(run, role) if run else None for run in runs]
    courses: Array = np.stack([part.weight[0, :, 0] for part in parts if part])
    changes = tuple(float(part.change[0, 0]) if part else None for part in parts)
    return RoleEvidence(seed_curve(courses), seed_estimate(changes), changes)
