"""The tables of what faults cost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from innerattn.experiments.robustness.results import (
    ALL,
    BoundLevel,
    BoundsOverRuns,
    Deployment,
    FaultTraining,
    TeamResult,
)
from innerattn.report.table import Row, Table, columns, plain_table
from innerattn.report.tables.text import mean_alone, number, percent, plus_minus
from innerattn.stats import Estimate

_RECOVERY = ("td-inner", "td-uniform", "oracle")
"""Policies whose retention is shown early and late: two methods, and the ceiling of a script."""


def retention_table(found: Deployment) -> Table:
    """Retention of each policy by kind of fault."""
    rows = _by_kind(found.kinds, lambda kind: [x.retention[kind] for x in found.policies])
    return plain_table(columns(["retention"], [one.name for one in found.policies]), rows)


def rescues_table(found: Deployment) -> Table:
    """Rescues of each policy without a fault, and with one."""
    rows = [
        ["without a fault", *(plus_minus(one.rescues) for one in found.policies)],
        ["with a fault", *(plus_minus(one.rescues_with_fault[ALL]) for one in found.policies)],
    ]
    return plain_table(columns(["rescues"], [one.name for one in found.policies]), rows)


def differences_table(found: Deployment) -> Table:
    """Retention with inner minus that with uniform attention."""
    each = found.differences.values()
    rows = _by_kind(found.kinds, lambda kind: [one[kind] for one in each])
    return plain_table(columns(["inner − uniform"], list(found.differences)), rows)


def recovery_table(found: Deployment) -> Table:
    """Retention soon after a fault in the middle of an episode, and later."""
    shown = [one for one in found.policies if one.name in _RECOVERY]
    heads = [f"{one.name}, {part}" for one in shown for part in ("early", "late", "difference")]
    rows = []
    for kind in found.kinds:
        parts = [one.after_onset[kind] for one in shown]
        cells = [plus_minus(x) for one in parts for x in (one.early, one.late, one.change)]
        rows.append([_words(kind), *cells])
    return plain_table(columns(["retention"], heads), rows)


def bounds_table(found: BoundsOverRuns) -> Table:
    """How far disturbances moved critics, beside the bounds."""
    heads = ("logit / bound", "largest", "Δα", "largest", "ΔQ", "largest", "actor flips")
    return plain_table(
        columns(["changed, direction, radius"], heads), [_level(one) for one in found.levels]
    )


def attention_table(found: Deployment) -> Table:
    """What the worst fault of each kind does to the weight on the robot that has it."""
    heads = [f"{method}, {x}" for method in found.attention for x in ("effect", "AUC", "by robot")]
    rows = []
    for kind in found.kinds:
        row = [_words(kind)]
        for shifts in found.attention.values():
            shift = shifts[kind]
            least, most = shift.by_robot
            row += [plus_minus(shift.effect), plus_minus(shift.auc), f"{least:+.2f} to {most:+.2f}"]
        rows.append(row)
    return plain_table(columns(["worst fault"], heads), rows)


def training_table(found: FaultTraining) -> Table:
    """Teams that were trained with faults, beside those that were not."""
    heads = [*(one.name for one in found.policies), "with − without", "mask"]
    named = [
        f"{_words(kind)} ({'seen' if index < found.seen else 'unseen'})"
        for index, kind in enumerate(found.kinds)
    ]
    rows = [
        Row((name, *_of_training(found, kind)))
        for name, kind in zip(named, found.kinds, strict=True)
    ]
    rows.append(Row((ALL, *_of_training(found, ALL)), strong=True))
    rows.append(
        Row(("rescues without a fault", *(plus_minus(one.rescues) for one in found.policies)))
    )
    return plain_table(columns(["retention"], heads), rows)


def _of_training(found: FaultTraining, kind: str) -> list[str]:
    each = [policy.retention[kind] for policy in found.policies]
    return [plus_minus(x) for x in (*each, found.gain[kind], found.mask[kind])]


def teams_table(found: Sequence[TeamResult]) -> Table:
    """What teams of different sizes retain when one robot is lost."""
    kinds = list(dict.fromkeys(kind for team in found for kind in team.retention))
    rows = [
        [
            f"{team.name} ({len(team.robots)} robots, {_food(team)} food), {team.policy}",
            mean_alone(team.rescues),
            *(number(team.retention.get(kind)) for kind in kinds),
        ]
        for team in found
    ]
    return plain_table(columns(["team"], ["rescues", *(f"{kind} lost" for kind in kinds)]), rows)


def _food(team: TeamResult) -> int:
    return sum(robot.startswith("food") for robot in team.robots)


def _by_kind(kinds: Sequence[str], values: Callable[[str], Iterable[Estimate | None]]) -> list[Row]:
    """A row for each kind of fault, and one for all."""
    rows = [Row((_words(kind), *map(plus_minus, values(kind)))) for kind in kinds]
    return [*rows, Row((ALL, *map(plus_minus, values(ALL))), strong=True)]


def _level(found: BoundLevel) -> list[str]:
    return [
        f"{found.changed}, {found.direction}, {found.radius:g}",
        *(f"{found.logit[0]:.3f}", f"{found.logit[1]:.2f}"),
        *(f"{found.weight[0]:.3f}", f"{found.weight[1]:.2f}"),
        *(f"{found.values[0]:.3f}", f"{found.values[1]:.2f}"),
        percent(found.actor_flips),
    ]


def _words(kind: str) -> str:
    return kind.replace("_", " ")
