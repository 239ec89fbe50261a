"""What faults cost, over the seeds of a study, from the documents of its groups."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.experiments.robustness.critics import (
    BoundsOverRuns,
    ShiftOverRuns,
    bounds_over_runs,
    shifts_over_runs,
)
from innerattn.experiments.robustness.design import WITH_FAULTS
from innerattn.experiments.robustness.documents import (
    AfterOnset,
    Estimates,
    GroupResult,
    PolicyUnderFaults,
    over_seeds,
)
from innerattn.experiments.robustness.measurement import read_measurements
from innerattn.experiments.run import FinishedRun
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate


@dataclass(frozen=True)
class Overall:
    """A policy, over seeds; of a single seed, intervals are over its worlds.

    Attributes:
        name: the method, or the script.
        rescues: per episode, without a fault.
        rescues_with_fault: with a fault from the start, by kind and `ALL`.
        retention: by kind and `ALL`.
        after_onset: by kind.
    """

    name: str
    rescues: Estimate | None
    rescues_with_fault: Estimates
    retention: Estimates
    after_onset: dict[str, AfterOnset]


@dataclass(frozen=True)
class Deployment:
    """Teams that were trained without faults, in one situation.

    Attributes:
        situation: of the worlds.
        kinds: of faults.
        policies: the methods, then scripts.
        differences: by algorithm, then by kind and `ALL`: retention with inner minus that with
            uniform attention, seed by seed.
        bounds: on the critics with inner attention; None where there is none.
        attention: by method with inner attention, then by kind.
    """

    situation: str
    kinds: tuple[str, ...]
    policies: tuple[Overall, ...]
    differences: dict[str, Estimates]
    bounds: BoundsOverRuns | None
    attention: dict[str, dict[str, ShiftOverRuns]]


@dataclass(frozen=True)
class FaultTraining:
    """Teams that were trained with faults, beside those that were not.

    Attributes:
        kinds: of faults, those met in training first.
        seen: how many of these were met in training.
        policies: trained with faults; the same with unavailable robots masked; without faults.
        gain: by kind and `ALL`, retention of the first minus that of the last, seed by seed.
        mask: the same of the second minus the first.
    """

    kinds: tuple[str, ...]
    seen: int
    policies: tuple[Overall, Overall, Overall]
    gain: Estimates
    mask: Estimates


@dataclass(frozen=True)
class TeamResult:
    """A team of some size whose robots are lost one at a time, from the start to the end.

    Attributes:
        name: of the built-in scenario.
        robots: names of the team.
        policy: the method of training, or the script.
        rescues: per episode, with all robots.
        retention: by kind of robot, a mean over its robots; None where nobody is rescued.
    """

    name: str
    robots: tuple[str, ...]
    policy: str
    rescues: Estimate | None
    retention: dict[str, float | None]


@dataclass(frozen=True)
class Robustness:
    """What faults cost; a part of which no group is measured is empty.

    Attributes:
        deployments: teams that were trained without faults, by situation.
        training: teams that were trained with faults.
        teams: teams by their size, with the scripts.
        seeds: of the deployments.
        episodes: worlds in which each fault of a deployment was tried.
    """

    deployments: tuple[Deployment, ...]
    training: FaultTraining | None
    teams: tuple[TeamResult, ...]
    seeds: tuple[int, ...]
    episodes: int


def read_robustness(runs: Sequence[FinishedRun], out: Path) -> Robustness:
    """What faults cost, from the documents of a study; they are read only.

    Args:
        runs: its finished runs.
        out: its folder.

    Raises:
        RunError: a document is damaged.
    """
    faulty = (run for run in runs if run.case.worlds == WITH_FAULTS)
    seen = {fault.kind for run in faulty for fault in run.config.scenario.faults}
    return over_groups(read_measurements(runs, out), seen)


def over_groups(found: Sequence[GroupResult], seen: Collection[str]) -> Robustness:
    """What faults cost, over the groups of a study.

    Args:
        found: the results of its groups.
        seen: kinds of faults that were met in training with faults.
    """
    deployed, trained, sized = (
        [one for one in found if one.group.part == part]
        for part in ("deployment", "training", "teams")
    )
    by_situation: dict[str, list[GroupResult]] = {}
    for one in deployed:
        by_situation.setdefault(one.group.cases[0].worlds, []).append(one)
    return Robustness(
        deployments=tuple(_deployment(*both) for both in by_situation.items()),
        training=_fault_training(trained, seen) if trained else None,
        teams=tuple(team for group in sized for team in _teams(group)),
        seeds=tuple(sorted({one.group.cases[0].seed for one in deployed})),
        episodes=max((one.group.episodes for one in deployed), default=0),
    )


def _deployment(situation: str, found: Sequence[GroupResult]) -> Deployment:
    by_seed = [
        {**{case.method: one for case, one in group.runs.items()}, **group.scripts}
        for group in found
    ]
    common = [name for name in by_seed[0] if all(name in each for each in by_seed)]
    differences = {}
    for method in common:
        algorithm, _, attention = method.rpartition("-")
        if attention == "inner" and f"{algorithm}-uniform" in common:
            differences[algorithm] = _differences(
                [(each[method], each[f"{algorithm}-uniform"]) for each in by_seed]
            )
    return Deployment(
        situation=situation,
        kinds=found[0].group.kinds,
        policies=tuple(_overall(name, [each[name] for each in by_seed]) for name in common),
        differences=differences,
        bounds=bounds_over_runs(found),
        attention=shifts_over_runs(found),
    )


def _fault_training(found: Sequence[GroupResult], seen: Collection[str]) -> FaultTraining:
    kinds = found[0].group.kinds
    met = [kind for kind in kinds if kind in seen]
    rows = [[group.runs[case] for case in group.group.cases] for group in found]
    names = ("trained with faults", "and masked", "without")
    first, second, last = (
        _overall(name, [row[place] for row in rows]) for place, name in enumerate(names)
    )
    return FaultTraining(
        kinds=(*met, *(kind for kind in kinds if kind not in met)),
        seen=len(met),
        policies=(first, second, last),
        gain=_differences([(row[0], row[2]) for row in rows]),
        mask=_differences([(row[1], row[0]) for row in rows]),
    )


def _teams(group: GroupResult) -> list[TeamResult]:
    """The trained team, and the scripts but greedy."""
    trained = {case.method: one for case, one in group.runs.items()}
    scripts = {name: one for name, one in group.scripts.items() if name != "greedy"}
    kinds = dict.fromkeys(robot.rpartition("_")[0] for robot in group.robots)
    return [
        TeamResult(
            name=group.group.cases[0].worlds,
            robots=group.robots,
            policy=name,
            rescues=policy.rescues,
            retention={kind: _of_kind(policy, kind) for kind in kinds},
        )
        for name, policy in {**trained, **scripts}.items()
    ]


def _of_kind(policy: PolicyUnderFaults, kind: str) -> float | None:
    values = [
        None if value is None else value.mean
        for robot, value in policy.without.items()
        if robot.rpartition("_")[0] == kind
    ]
    known = [value for value in values if value is not None]
    return statistics.mean(known) if len(known) == len(values) else None


def _overall(name: str, found: Sequence[PolicyUnderFaults]) -> Overall:
    first = found[0]

    def by_name(part: Callable[[PolicyUnderFaults], Estimates]) -> Estimates:
        return {kind: over_seeds([part(one)[kind] for one in found]) for kind in part(first)}

    return Overall(
        name=name,
        rescues=over_seeds([one.rescues for one in found]),
        rescues_with_fault=by_name(lambda one: one.rescues_with_fault),
        retention=by_name(lambda one: one.retention),
        after_onset={
            kind: AfterOnset(
                early=over_seeds([one.after_onset[kind].early for one in found]),
                late=over_seeds([one.after_onset[kind].late for one in found]),
                change=over_seeds([one.after_onset[kind].change for one in found]),
            )
            for kind in first.after_onset
        },
    )


def _differences(pairs: Sequence[tuple[PolicyUnderFaults, PolicyUnderFaults]]) -> Estimates:
    """Retention of the first minus that of the second, by kind; one difference per seed."""

    def difference(one: Estimate | None, other: Estimate | None) -> float | None:
        return None if one is None or other is None else one.mean - other.mean

    return {
        kind: seed_estimate(
            [difference(one.retention[kind], other.retention[kind]) for one, other in pairs]
        )
        for kind in pairs[0][0].retention
    }
