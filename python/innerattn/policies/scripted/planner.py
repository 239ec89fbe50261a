"""Schedules for instances of task allocation: a planner, and two plain ones to compare it with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.config.instances import Instance
from innerattn.errors import ScheduleError

PLANNERS = ("planner", "greedy", "random")
"""Names that `schedule_by` knows."""


@dataclass(frozen=True)
class Schedule:
    """Who goes where, in which order, and what comes of it. Times have the instance's units.

    Attributes:
        tasks: for each robot, the tasks that it goes to.
        starts: for each task, when all its robots are there and work begins.
        returns: for each robot, when it is back at its depot; 0 if it never leaves.
        makespan: when the last robot is back.
    """

    tasks: tuple[tuple[int, ...], ...]
    starts: tuple[float, ...]
    returns: tuple[float, ...]
    makespan: float


def simulate(instance: Instance, tasks: Sequence[Sequence[int]]) -> Schedule:
    """What comes of a schedule, exactly: each robot waits at a task until all needs are filled.

    Args:
        instance: the robots and tasks.
        tasks: for each robot, the tasks that it goes to, in order.

    Raises:
        ScheduleError: a task does not get exactly the robots that it needs, or robots wait for
            each other for ever.
    """
    try:
        starts, returns, makespan = instance.compiled().simulate(tasks)
    except (ValueError, OverflowError) as error:
        raise ScheduleError(f"{instance.name}: {error}") from error
    return Schedule(tuple(map(tuple, tasks)), tuple(starts), tuple(returns), makespan)


def plan(
    instance: Instance,
    time_limit_s: float | None = 1.0,
    evaluations: int | None = None,
    seed: int = 0,
) -> Schedule:
    """The shortest schedule that simulated annealing over the order of the tasks finds.

    Each task in the order gets the robots with which it begins soonest and, of those that come in
    time, the ones that come last. The search ends at the first limit. With ``evaluations`` and
    no time limit it gives the same bits on every machine.

    Args:
        instance: the robots and tasks.
        time_limit_s: how long to search [s]; None: as long as ``evaluations`` says.
        evaluations: how many orders to try; None: as many as the time allows.
        seed: of the search.

    Raises:
        ValueError: there is no limit, or one is out of range.
    """
    tasks, _ = instance.compiled().plan(seed, evaluations, time_limit_s)
    return simulate(instance, tasks)


def schedule_by(name: str, instance: Instance, time_limit_s: float, seed: int) -> Schedule:
    """The schedule of one of `PLANNERS`.

    ``planner`` is `plan`. ``greedy`` always does the task next that can begin soonest. ``random``
    does tasks in a random order, each with random robots.

    Args:
        name: of the planner.
        instance: the robots and tasks.
        time_limit_s: how long ``planner`` searches [s].
        seed: of ``planner`` and ``random``.
    """
    if name == "planner":
        return plan(instance, time_limit_s, seed=seed)
    compiled = instance.compiled()
    return simulate(instance, compiled.greedy() if name == "greedy" else compiled.random(seed))
