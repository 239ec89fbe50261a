"""Measures planners on instances of task allocation."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from innerattn.config.instances import Instance
from innerattn.config.instances.bodies import Engine
from innerattn.evaluate.played_schedule import most_time, play_schedule
from innerattn.policies.scripted.planner import SEARCHING, schedule_by

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Solved:
    """What a planner found for one instance.

    Attributes:
        instance: which one.
        makespan: of the planner's schedule, in the instance's units; with an engine, until the last
            robot was back.
        seconds: what the planner took [s].
        is_done: whether all robots were back before the time was up.
    """

    instance: Instance
    makespan: float
    seconds: float
    is_done: bool = True

    def to_json(self) -> dict[str, Any]:
        """As a part of `InstanceResults.to_json`."""
        return {
            "name": self.instance.name,
            "makespan": self.makespan,
            "seconds": self.seconds,
            "is_done": self.is_done,
            "published_makespan": self.instance.makespan_milp_600s,
            "lower_bound": self.instance.lower_bound_milp,
        }


@dataclass(frozen=True)
class InstanceResults:
    """What a planner found for several instances.

    Attributes:
        policy: name of the planner.
        seed: of the planner.
        time_limit_ms: how long it was to search for each instance [ms]; None: it had no limit, or
            does not search.
        evaluations: orders that it was to try for each instance; None: it had no such limit.
        engine: of the worlds in which its schedules were played; None: they were simulated exactly.
        solved: one for each instance, in order.
    """

    policy: str
    seed: int
    time_limit_ms: int | None
    solved: tuple[Solved, ...]
    engine: Engine | None = None
    evaluations: int | None = None

    @property
    def mean_makespan(self) -> float:
        """Mean over all instances."""
        return sum(one.makespan for one in self.solved) / len(self.solved)

    @property
    def mean_seconds(self) -> float:
        """What the planner took for an instance [s]."""
        return sum(one.seconds for one in self.solved) / len(self.solved)

    @property
    def published_mean_makespan(self) -> float | None:
        """Mean of the published makespans; None where an instance has none."""
        published = [one.instance.makespan_milp_600s for one in self.solved]
        known = [makespan for makespan in published if makespan is not None]
        return sum(known) / len(known) if len(known) == len(published) else None

    @property
    def ratio(self) -> float | None:
        """Mean makespan divided by the published mean; None where an instance has none."""
        published = self.published_mean_makespan
        return None if published is None else self.mean_makespan / published

    def to_json(self) -> dict[str, Any]:
        """The document that `innerattn evaluate --instances` writes."""
        return {
            "schema_version": SCHEMA_VERSION,
            "policy": self.policy,
            "seed": self.seed,
            "time_limit_ms": self.time_limit_ms,
            "evaluations": self.evaluations,
            "engine": self.engine,
            "instances": [one.to_json() for one in self.solved],
            "mean_makespan": self.mean_makespan,
            "published_mean_makespan": self.published_mean_makespan,
            "ratio": self.ratio,
        }


def solve_instances(
    policy: str,
    instances: Sequence[Instance],
    time_limit_ms: int | None,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
    engine: Engine | None = None,
    evaluations: int | None = None,
) -> InstanceResults:
    """Let a planner make a schedule for each instance, and simulate it or play it in a world.

    Args:
        policy: one of `innerattn.policies.scripted.planner.PLANNERS`, as `schedule_by` takes it.
        instances: one or more.
        time_limit_ms: how long it searches for each [ms], if it does; None: as long as
            ``evaluations`` says.
        seed: of the planner, the same for each instance.
        progress: is told how many instances of how many are done.
        engine: of the worlds in which schedules are played, see `play_schedule`; None: they are
            simulated exactly, as of points.
        evaluations: orders that it tries for each, if it searches; None: no limit.

    Raises:
        ConfigError: an instance has no world.
    """
    solved = []
    limit_s = None if time_limit_ms is None else time_limit_ms / 1000
    for instance in instances:
        began = time.perf_counter()
        schedule = schedule_by(policy, instance, limit_s, seed, evaluations)
        seconds = time.perf_counter() - began
        makespan: float | None = schedule.makespan
        if engine is not None:
            makespan = play_schedule(instance, schedule, engine)
        is_done = makespan is not None
        solved.append(Solved(instance, makespan or most_time(schedule), seconds, is_done))
        if progress is not None:
            progress(len(solved), len(instances))
    if policy.partition(":")[0] not in SEARCHING:
        time_limit_ms = evaluations = None
    return InstanceResults(policy, seed, time_limit_ms, tuple(solved), engine, evaluations)
