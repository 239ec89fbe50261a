"""Schedules for instances of task allocation: a planner, and two plain ones to compare it with."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.config.instances import Instance
from innerattn.errors import ScheduleError
from innerattn.policies.orders.learnt import learnt_order, read_network, shipped_network

PLANNERS = ("planner", "guided", "learnt", "greedy", "random")
"""Names that `schedule_by` knows."""
SEARCHING = ("planner", "guided")
"""Those that search for as long as they may."""
LEARNT = ("learnt", "guided")
"""Those that use a learnt policy, their own or that of a file: ``learnt:FILE``."""
SAMPLES = 32
"""Orders of the learnt policy, of which the shortest counts."""


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
    order: Sequence[int] | None = None,
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
        order: of all tasks, that the search begins with; None: that of ``greedy``.

    Raises:
        ValueError: there is no limit, one is out of range, or ``order`` has not each task once.
    """
    tasks, _ = instance.compiled().plan(seed, evaluations, time_limit_s, order)
    return simulate(instance, tasks)


def schedule_by(
    name: str,
    instance: Instance,
    time_limit_s: float | None,
    seed: int,
    evaluations: int | None = None,
) -> Schedule:
    """The schedule of one of `PLANNERS`.

    ``planner`` is `plan`. ``learnt`` is the shortest of some orders of a learnt policy; ``guided``
    is `plan` that begins with it. ``greedy`` always does the task next that can begin soonest.
    ``random`` does tasks in a random order, each with random robots.

    Args:
        name: of the planner; ``learnt:FILE`` and ``guided:FILE`` use the policy of a file.
        instance: the robots and tasks.
        time_limit_s: how long one of `SEARCHING` searches [s], its policy included; None: as long
            as ``evaluations`` says.
        seed: of all but ``greedy``.
        evaluations: how many orders one of `SEARCHING` tries; None: as many as the time allows.

    Raises:
        RunError: the file holds no policy.
    """
    kind, _, file = name.partition(":")
    if kind == "planner":
        return plan(instance, time_limit_s, evaluations, seed)
    compiled = instance.compiled()
    if kind in ("greedy", "random"):
        return simulate(instance, compiled.greedy() if kind == "greedy" else compiled.random(seed))
    began = time.perf_counter()
    network = read_network(Path(file)) if file else shipped_network()
    order = learnt_order(instance, network, SAMPLES, seed)
    if kind == "learnt":
        return simulate(instance, compiled.schedule(order))
    if time_limit_s is not None:
        time_limit_s = max(time_limit_s - (time.perf_counter() - began), 0.0)
    return plan(instance, time_limit_s, evaluations, seed, order)
