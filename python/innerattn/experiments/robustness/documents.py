"""What a document of ``innerattn robustness --json`` says about the runs of one group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from innerattn.experiments.plan import Case
from innerattn.experiments.robustness.design import Group
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate

ALL = "all"
"""Beside the kinds of faults: their mean."""

Estimates = dict[str, Estimate | None]
"""Estimates by name; None where nobody is rescued without the fault."""


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
class PolicyUnderFaults:
    """What one policy does under faults. Estimates are over worlds.

    Attributes:
        rescues: per episode, without a fault.
        rescues_with_fault: the same with a fault from the start, by kind and `ALL`.
        retention: by kind and `ALL`.
        after_onset: by kind.
        without: by robot, retention where it is unavailable from the start to the end.
    """

    rescues: Estimate | None
    rescues_with_fault: Estimates
    retention: Estimates
    after_onset: dict[str, AfterOnset]
    without: Estimates


@dataclass(frozen=True)
class BoundLevel:
    """Changes of one kind and size, and what they moved: median and largest.

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
class CriticBounds:
    """The bounds on inner attention, checked on one critic.

    Attributes:
        checks: of all inequalities.
        violations: among these.
        levels: of changes that aim at teammates.
    """

    checks: int
    violations: int
    levels: tuple[BoundLevel, ...]


@dataclass(frozen=True)
class AttentionShift:
    """What the worst fault of one kind does to the weight on the robot that has it, in one run.

    Attributes:
        effect: on the mean weight, over robots.
        auc: how well the weight tells that the robot is faulty.
        by_robot: the effect on each robot.
    """

    effect: Estimate
    auc: Estimate
    by_robot: tuple[float, ...]


@dataclass(frozen=True)
class GroupResult:
    """What the runs of a group and the scripts do in the same worlds.

    Attributes:
        group: the runs and the faults.
        robots: names of the team.
        runs: by case.
        scripts: by name.
        bounds: by case; of critics with inner attention.
        attention: by case and kind; likewise.
        critics: how many critics were checked, with or without inner attention.
    """

    group: Group
    robots: tuple[str, ...]
    runs: dict[Case, PolicyUnderFaults]
    scripts: dict[str, PolicyUnderFaults]
    bounds: dict[Case, CriticBounds]
    attention: dict[Case, dict[str, AttentionShift]]
    critics: int


def over_seeds(found: Sequence[Estimate | None]) -> Estimate | None:
    """The mean over seeds, by Student's t; of a single seed its own estimate, over its worlds."""
    if len(found) == 1:
        return found[0]
    return seed_estimate([None if one is None else one.mean for one in found])


def group_result(group: Group, document: Mapping[str, Any]) -> GroupResult:
    """The results that a document of a group's runs, in their order, holds.

    Raises:
        KeyError, TypeError, ValueError: it is another document.
    """
    policies = document["policies"]
    trained = dict(zip(group.cases, policies, strict=False))
    names = {policy["policy"]: case for case, policy in trained.items()}
    return GroupResult(
        group=group,
        robots=tuple(document["robots"]),
        runs={case: _policy(policy) for case, policy in trained.items()},
        scripts={one["policy"]: _policy(one) for one in policies[len(group.cases) :]},
        bounds={
            names[name]: _bounds(one)
            for name, one in document["bounds"].items()
            if one["attention"] == "inner"
        },
        attention={
            names[name]: {kind["kind"]: _shift(kind) for kind in one["kinds"]}
            for name, one in document["attention"].items()
        },
        critics=len(document["bounds"]),
    )


def _policy(found: Mapping[str, Any]) -> PolicyUnderFaults:
    return PolicyUnderFaults(
        rescues=_estimate(found["rescues_per_episode"]),
        rescues_with_fault=_estimates(found["rescues_with_fault"]),
        retention=_estimates(found["by_kind"]),
        after_onset={
            kind: AfterOnset(
                *(_estimate(part[name]) for name in ("early", "late", "late_minus_early"))
            )
            for kind, part in found["after_onset"].items()
        },
        without={
            cell["robot"]: _estimate(cell["retention"])
            for cell in found["cells"]
            if (cell["kind"], cell["severity"], cell["onset"]) == ("unavailable", 1.0, "start")
        },
    )


def _bounds(found: Mapping[str, Any]) -> CriticBounds:
    levels = found["levels"]
    return CriticBounds(
        checks=sum(int(one["checks"]) for level in levels for one in level["checks"].values()),
        violations=int(found["violations"]),
        levels=tuple(_level(level) for level in levels if level["direction"] != "gradient_own"),
    )


def _level(found: Mapping[str, Any]) -> BoundLevel:
    logit, weight, values = found["checks"]["logit"], found["checks"]["weight"], found["teammates"]
    return BoundLevel(
        changed=found["changed"],
        direction=found["direction"],
        radius=float(found["radius"]),
        logit=(logit["median_tightness"], logit["largest_tightness"]),
        weight=(weight["median_change"], weight["largest_change"]),
        values=(values["median"], values["largest"]),
        actor_flips=found["actor_flips"],
    )


def _shift(found: Mapping[str, Any]) -> AttentionShift:
    return AttentionShift(
        effect=Estimate.from_json(found["effect"]["mean"]),
        auc=Estimate.from_json(found["auc"]["mean"]),
        by_robot=tuple(float(robot["effect"]["mean"]["mean"]) for robot in found["robots"]),
    )


def _estimates(found: Mapping[str, Any]) -> Estimates:
    return {name: _estimate(value) for name, value in found.items()}


def _estimate(found: Mapping[str, Any] | None) -> Estimate | None:
    return None if found is None else Estimate.from_json(found)
