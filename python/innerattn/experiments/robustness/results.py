"""What faults cost, over the seeds of a study, from the documents of its groups.

A document is what ``innerattn robustness --json`` says about the runs of one group, in their order,
and about the scripts in the same worlds.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import Any, NamedTuple

from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import RunError
from innerattn.experiments.robustness.design import WITH_FAULTS, Group
from innerattn.experiments.robustness.measurement import measurements
from innerattn.experiments.run import FinishedRun
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate

ALL = "all"
"""Beside the kinds of faults: their mean."""

Estimates = dict[str, Estimate | None]
"""Estimates by name; None where nobody is rescued without the fault."""


class Measured(NamedTuple):
    """A group and its document."""

    group: Group
    document: Mapping[str, Any]


@dataclass(frozen=True)
class AfterOnset:
    """Retention after a fault in the middle of an episode.

    Attributes:
        early: in the first half of the time that is left.
        late: in its second half.
        change: late minus early.
    """

    early: Estimate | None
    late: Estimate | None
    change: Estimate | None


@dataclass(frozen=True)
class BoundLevel:
    """Changes of one kind and size: means of medians and largest values of what they moved.

    Attributes:
        changed: "embedding" or "observation".
        direction: "random" or "gradient".
        radius: the size, as a share of the norm.
        logit: the change of a logit over its bound.
        weight: the change of an attention weight.
        values: the change of the teammates' values.
        actor_flips: share in which the actor's likeliest action became another; None where the
            embedding is changed.
    """

    changed: str
    direction: str
    radius: float
    logit: tuple[float, float]
    weight: tuple[float, float]
    values: tuple[float, float]
    actor_flips: float | None


@dataclass(frozen=True)
class BoundsOverRuns:
    """The bounds on attention, over critics.

    Attributes:
        critics: how many with inner attention; others have no logits.
        runs: how many in all.
        checks: of all inequalities.
        violations: among these.
        levels: of changes that aim at teammates.
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
        RunError: a document is a link, damaged, or of another version.
    """
    faulty = (run for run in runs if run.case.worlds == WITH_FAULTS)
    seen = {fault.kind for run in faulty for fault in run.config.scenario.faults}
    return over_groups(read_measurements(runs, out), seen)


def read_measurements(runs: Sequence[FinishedRun], out: Path) -> list[Measured]:
    """The groups of finished runs that are measured; each document is read once.

    Raises:
        RunError: as of `read_robustness`.
    """
    found = []
    for one in measurements([run.case for run in runs], runs, out):
        if one.path.exists():
            try:
                document = parse_json(read_plain(one.path, MOST_JSON_BYTES))
                found.append(Measured(one.group, document))
                over_groups(found[-1:], ())  # which tells whether all is there
            except (OSError, ValueError, LookupError, TypeError) as error:
                reason = "not a measurement under faults of this version; remove it"
                raise RunError(f"{one.path}: {reason}") from error
    return found


def over_groups(found: Sequence[Measured], seen: Collection[str]) -> Robustness:
    """What faults cost, over the groups of a study.

    Args:
        found: its groups with their documents.
        seen: kinds of faults that were met in training with faults.

    Raises:
        LookupError, TypeError, ValueError: a document is another one.
    """
    deployed, trained, sized = (
        [one for one in found if one.group.part == part]
        for part in ("deployment", "training", "teams")
    )
    by_situation: dict[str, list[Measured]] = {}
    for one in deployed:
        by_situation.setdefault(one.group.cases[0].worlds, []).append(one)
    return Robustness(
        deployments=tuple(_deployment(*both) for both in by_situation.items()),
        training=_fault_training(trained, seen) if trained else None,
        teams=tuple(team for group in sized for team in _teams(group)),
        seeds=tuple(sorted({one.group.cases[0].seed for one in deployed})),
        episodes=max((one.group.episodes for one in deployed), default=0),
    )


def _by_policy(found: Measured) -> dict[str, Mapping[str, Any]]:
    """What a document says of runs by their method, then of scripts by name."""
    policies = found.document["policies"]
    methods = [case.method for case in found.group.cases]
    names = [*methods, *(one["policy"] for one in policies[len(methods) :])]
    return dict(zip(names, policies, strict=True))


def _deployment(situation: str, found: Sequence[Measured]) -> Deployment:
    by_seed = [_by_policy(one) for one in found]
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
        bounds=_bounds([one for of in found for one in of.document["bounds"].values()]),
        attention=_shifts(found),
    )


def _fault_training(found: Sequence[Measured], seen: Collection[str]) -> FaultTraining:
    kinds = found[0].group.kinds
    met = [kind for kind in kinds if kind in seen]
    faulty, masked, without = zip(*(one.document["policies"][:3] for one in found), strict=True)
    return FaultTraining(
        kinds=(*met, *(kind for kind in kinds if kind not in met)),
        seen=len(met),
        policies=(
            _overall("trained with faults", faulty),
            _overall("and masked", masked),
            _overall("without", without),
        ),
        gain=_differences(list(zip(faulty, without, strict=True))),
        mask=_differences(list(zip(masked, faulty, strict=True))),
    )


def _teams(found: Measured) -> list[TeamResult]:
    """The trained team, and the scripts but greedy."""
    robots = tuple(found.document["robots"])
    kinds = dict.fromkeys(robot.rpartition("_")[0] for robot in robots)
    return [
        TeamResult(
            name=found.group.cases[0].worlds,
            robots=robots,
            policy=name,
            rescues=over_seeds([policy["rescues_per_episode"]]),
            retention={kind: _without(policy, kind) for kind in kinds},
        )
        for name, policy in _by_policy(found).items()
        if name != "greedy"
    ]


def _without(policy: Mapping[str, Any], kind: str) -> float | None:
    """Retention without a robot of a kind from start to end, a mean over these."""
    values = [
        cell["retention"]
        for cell in policy["cells"]
        if cell["robot"].rpartition("_")[0] == kind
        and (cell["kind"], cell["severity"], cell["onset"]) == ("unavailable", 1.0, "start")
    ]
    return None if None in values else mean(float(value["mean"]) for value in values)


def _overall(name: str, found: Sequence[Mapping[str, Any]]) -> Overall:
    def by_name(key: str) -> Estimates:
        return {kind: over_seeds([one[key][kind] for one in found]) for kind in found[0][key]}

    return Overall(
        name=name,
        rescues=over_seeds([one["rescues_per_episode"] for one in found]),
        rescues_with_fault=by_name("rescues_with_fault"),
        retention=by_name("by_kind"),
        after_onset={
            kind: AfterOnset(
                *(
                    over_seeds([one["after_onset"][kind][part] for one in found])
                    for part in ("early", "late", "late_minus_early")
                )
            )
            for kind in found[0]["after_onset"]
        },
    )


def over_seeds(found: Sequence[Mapping[str, Any] | None]) -> Estimate | None:
    """The mean over seeds, by Student's t; of a single seed its own estimate, over its worlds."""
    if len(found) == 1:
        return None if found[0] is None else Estimate.from_json(found[0])
    return seed_estimate([None if one is None else float(one["mean"]) for one in found])


def _differences(pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> Estimates:
    """Retention of the first minus that of the second, by kind; one difference per seed."""
    differences = {}
    for kind in pairs[0][0]["by_kind"]:
        both = [(one["by_kind"][kind], other["by_kind"][kind]) for one, other in pairs]
        differences[kind] = seed_estimate(
            [None if None in pair else pair[0]["mean"] - pair[1]["mean"] for pair in both]
        )
    return differences


def _bounds(critics: Sequence[Mapping[str, Any]]) -> BoundsOverRuns | None:
    """The bounds on critics; None where none has inner attention."""
    checked = [one for one in critics if one["attention"] == "inner"]
    if not checked:
        return None
    levels = [level for one in checked for level in one["levels"]]
    aimed = ([x for x in one["levels"] if x["direction"] != "gradient_own"] for one in checked)
    return BoundsOverRuns(
        critics=len(checked),
        runs=len(critics),
        checks=sum(int(one["checks"]) for level in levels for one in level["checks"].values()),
        violations=sum(int(one["violations"]) for one in checked),
        levels=tuple(_level(same) for same in zip(*aimed, strict=True)),
    )


def _level(same: Sequence[Mapping[str, Any]]) -> BoundLevel:
    """One level of all critics."""

    def middle_and_largest(found: Sequence[Mapping[str, float]], of: str) -> tuple[float, float]:
        return mean(one[f"median{of}"] for one in found), max(one[f"largest{of}"] for one in found)

    flips = [one["actor_flips"] for one in same if one["actor_flips"] is not None]
    return BoundLevel(
        changed=same[0]["changed"],
        direction=same[0]["direction"],
        radius=float(same[0]["radius"]),
        logit=middle_and_largest([one["checks"]["logit"] for one in same], "_tightness"),
        weight=middle_and_largest([one["checks"]["weight"] for one in same], "_change"),
        values=middle_and_largest([one["teammates"] for one in same], ""),
        actor_flips=mean(flips) if flips else None,
    )


def _shifts(found: Sequence[Measured]) -> dict[str, dict[str, ShiftOverRuns]]:
    """What faults do to the attention of groups, by method with inner attention, then by kind."""
    runs: dict[str, list[dict[str, Any]]] = {}
    for group, document in found:
        for case, policy in zip(group.cases, document["policies"], strict=False):
            if policy["policy"] in document["attention"]:
                kinds = document["attention"][policy["policy"]]["kinds"]
                runs.setdefault(case.method, []).append({one["kind"]: one for one in kinds})
    return {
        method: {kind: _shift([one[kind] for one in own]) for kind in own[0]}
        for method, own in runs.items()
    }


def _shift(runs: Sequence[Mapping[str, Any]]) -> ShiftOverRuns:
    each = [float(robot["effect"]["mean"]["mean"]) for one in runs for robot in one["robots"]]
    return ShiftOverRuns(
        effect=over_seeds([one["effect"]["mean"] for one in runs]),
        auc=over_seeds([one["auc"]["mean"] for one in runs]),
        by_robot=(min(each), max(each)),
    )
