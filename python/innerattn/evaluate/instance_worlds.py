"""Measures policies in worlds in which nothing but the policy is left to chance."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from innerattn.config import Scenario
from innerattn.config.instances import Reference, WorldInstance
from innerattn.errors import InnerattnError
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import load_trained
from innerattn.policies import SCRIPTS, Policy, scripted_policy
from innerattn.train.build import torch_threads

SCHEMA_VERSION = 1

REFERENCES = ("greedy", "hungarian", "planner")
"""Scripts of which the best is the reference of a world."""


@dataclass(frozen=True)
class Played:
    """What a policy reached in a world.

    Attributes:
        makespan_s: when the last victim was rescued or lost; the end of the episode where some
            were neither [s].
        rescued: how many victims it rescued.
        seconds: what the policy and the world took [s].
    """

    makespan_s: float
    rescued: int
    seconds: float


@dataclass(frozen=True)
class PlayedWorld:
    """A world, and what a policy reached in it.

    Attributes:
        instance: the world.
        played: None where the policy cannot play it.
        refusal: why it cannot; empty where it can.
    """

    instance: WorldInstance
    played: Played | None
    refusal: str = ""

    @property
    def score(self) -> float | None:
        """1 where the policy does as the reference did; more is better.

        The makespan of the reference divided by that of the policy; where victims can be lost,
        rescues divided by those of the reference.
        """
        if self.played is None:
            return None
        reference = self.instance.reference
        if self.instance.can_lose:
            return self.played.rescued / reference.rescued
        return reference.makespan_s / self.played.makespan_s

    def to_json(self) -> dict[str, Any]:
        """As a part of `WorldResults.to_json`."""
        played = self.played
        return {
            "name": self.instance.name,
            "feature": self.instance.feature,
            "robots": self.instance.scenario.num_robots,
            "victims": self.instance.victims,
            "makespan": None if played is None else played.makespan_s,
            "rescued": None if played is None else played.rescued,
            "score": self.score,
            "seconds": None if played is None else played.seconds,
            "reference": self.instance.reference.model_dump(),
            "refusal": self.refusal or None,
        }


@dataclass(frozen=True)
class WorldResults:
    """What a policy reached in several worlds.

    Attributes:
        policy: its name.
        seed: of what it draws.
        worlds: one for each instance, in order; one at least was played.
    """

    policy: str
    seed: int
    worlds: tuple[PlayedWorld, ...]

    def of(self, feature: str) -> WorldResults:
        """Those of one feature alone."""
        kept = (one for one in self.worlds if one.instance.feature == feature)
        return WorldResults(self.policy, self.seed, tuple(kept))

    @property
    def features(self) -> tuple[str, ...]:
        """The features of the worlds, in order."""
        return tuple(dict.fromkeys(one.instance.feature for one in self.worlds))

    @property
    def played(self) -> tuple[Played, ...]:
        """What was reached in the worlds that the policy can play."""
        return tuple(one.played for one in self.worlds if one.played is not None)

    @property
    def score(self) -> float | None:
        """Mean score of the worlds that were played; None where none was."""
        return _mean([one.score for one in self.worlds if one.score is not None])

    @property
    def mean_makespan_s(self) -> float | None:
        """Mean over the worlds that were played [s]; None where none was."""
        return _mean([one.makespan_s for one in self.played])

    @property
    def rescued_share(self) -> float | None:
        """Share of the victims of the worlds that were played; None where none was."""
        victims = sum(one.instance.victims for one in self.worlds if one.played is not None)
        return sum(one.rescued for one in self.played) / victims if victims else None

    def to_json(self) -> dict[str, Any]:
        """The document that `innerattn evaluate --instances` writes."""
        return {
            "schema_version": SCHEMA_VERSION,
            "policy": self.policy,
            "seed": self.seed,
            "instances": [one.to_json() for one in self.worlds],
            "features": {name: self.of(name).means() for name in self.features},
            **self.means(),
        }

    def means(self) -> dict[str, Any]:
        """How many worlds were played, and the means over them."""
        return {
            "played": len(self.played),
            "score": self.score,
            "rescued_share": self.rescued_share,
            "mean_makespan": self.mean_makespan_s,
        }


def play_world(policy: Policy, scenario: Scenario, seed: int = 0) -> Played:
    """Let a policy play one episode of a world.

    Args:
        policy: what drives the robots.
        scenario: the world; its episodes end when all victims of a list are done.
        seed: of what the policy draws, and of what the scenario leaves to chance.
    """
    began = time.perf_counter()
    record = run_episodes(policy, scenario, 1, seed, num_threads=1)
    seconds = time.perf_counter() - began
    return Played(float(record.lengths[0]) * scenario.dt_s, len(record.rescues), seconds)


def with_reference(name: str, feature: str, scenario: Scenario) -> WorldInstance:
    """A world and, as its reference, the best of `REFERENCES`: most rescues, then least time.

    Args:
        name: of the world, unique in its file.
        feature: what is special about it.
        scenario: its episodes end when all victims of a list are done.

    Raises:
        pydantic.ValidationError: (a `ValueError`) the scenario has no such end, or no script
            rescues anybody.
    """
    played = {one: play_world(scripted_policy(one, scenario), scenario) for one in REFERENCES}
    best = max(REFERENCES, key=lambda one: (played[one].rescued, -played[one].makespan_s))
    found = Reference(policy=best, rescued=played[best].rescued, makespan_s=played[best].makespan_s)
    return WorldInstance(name=name, feature=feature, scenario=scenario, reference=found)


def evaluate_worlds(
    policy: str,
    instances: Sequence[WorldInstance],
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> WorldResults:
    """Let a script or a trained team play each world once.

    A team that was trained for other robots or tasks, or knows no batteries, say, cannot play some
    worlds; they are left out of the means.

    Args:
        policy: the name of a script, or a run, or ``zoo:NAME``.
        instances: one or more.
        seed: see `play_world`.
        progress: is told how many worlds of how many are done.

    Raises:
        InnerattnError: it can play none of the worlds, for the reason given for the first.
    """
    worlds = []
    refused: InnerattnError | None = None
    for instance in instances:
        try:
            chosen = _policy(policy, instance.scenario, seed)
        except InnerattnError as error:
            refused = refused or error
            worlds.append(PlayedWorld(instance, None, str(error)))
        else:
            with torch_threads(1):  # one world at a time is too little for more
                played = play_world(chosen, instance.scenario, seed)
            worlds.append(PlayedWorld(instance, played))
        if progress is not None:
            progress(len(worlds), len(instances))
    results = WorldResults(policy, seed, tuple(worlds))
    if refused is not None and not results.played:
        raise refused
    return results


def _policy(name: str, scenario: Scenario, seed: int) -> Policy:
    return (
        scripted_policy(name, scenario, seed)
        if name in SCRIPTS
        else load_trained(name, scenario)[1]
    )


def _mean(values: list[float]) -> float | None:
    return sum(values) / len(values) if values else None
