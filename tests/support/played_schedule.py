"""Schedules of instances, played and made by plain code: nothing here is fast."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence

from innerattn.config.instances import Instance

Place = tuple[float, float]


def travel(instance: Instance, start: Place, end: Place) -> float:
    """Time from one place to another."""
    x, y = start[0] - end[0], start[1] - end[1]
    return math.sqrt(x * x + y * y) / instance.speed


def can_do(instance: Instance, task: int, robots: Sequence[int]) -> bool:
    """Whether these robots can fill all needs of a task, one each; by trying all ways."""
    needs = instance.tasks[task].skills
    if len(robots) != len(needs):
        return False
    return any(
        all(need in instance.robots[robot].skills for need, robot in zip(needs, one, strict=True))
        for one in itertools.permutations(robots)
    )


def played(
    instance: Instance, schedule: Sequence[Sequence[int]]
) -> tuple[list[float], list[float]] | None:
    """When tasks begin and robots are back, by a queue of events in time; None in a deadlock."""
    starts = [math.inf] * len(instance.tasks)
    returns = [0.0] * len(instance.robots)
    present: list[list[int]] = [[] for _ in instance.tasks]
    left = [list(tasks) for tasks in schedule]
    events: list[tuple[float, int, str, int]] = []

    def leave(robot: int, place: Place, now: float) -> None:
        depot = instance.robots[robot].depot
        if left[robot]:
            way = travel(instance, place, instance.tasks[left[robot][0]].position)
            heapq.heappush(events, (now + way, robot, "arrives", left[robot].pop(0)))
        elif schedule[robot]:
            returns[robot] = now + travel(instance, depot, place)

    for robot, described in enumerate(instance.robots):
        leave(robot, described.depot, 0.0)
    while events:
        now, robot, event, task = heapq.heappop(events)
        if event == "leaves":
            leave(robot, instance.tasks[task].position, now)
            continue
        present[task].append(robot)
        if can_do(instance, task, present[task]):
            starts[task] = now
            for helper in present[task]:
                heapq.heappush(
                    events, (now + instance.tasks[task].duration, helper, "leaves", task)
                )
    return None if math.inf in starts else (starts, returns)


def made_greedily(instance: Instance) -> list[list[int]]:
    """The schedule of `greedy`: always the task that can begin soonest, by trying all coalitions.

    Of coalitions that begin equally soon it takes the robots that come last, the way home counted
    1.01 times against them.
    """
    schedule: list[list[int]] = [[] for _ in instance.robots]
    free = [0.0] * len(instance.robots)
    place = [robot.depot for robot in instance.robots]
    tasks = list(range(len(instance.tasks)))
    while tasks:
        best = None
        for task in tasks:
            there = instance.tasks[task].position
            arrival = [
                free[robot] + travel(instance, place[robot], there) for robot in range(len(free))
            ]
            rank = [
                arrival[robot] - 1.01 * travel(instance, described.depot, there)
                for robot, described in enumerate(instance.robots)
            ]
            for team in itertools.combinations(range(len(free)), len(instance.tasks[task].skills)):
                if can_do(instance, task, team):
                    start = max(arrival[robot] for robot in team)
                    key = start, task, sorted((-rank[robot], robot) for robot in team)
                    best = min(best, (key, team)) if best else (key, team)
        assert best is not None
        (start, task, _), team = best
        tasks.remove(task)
        for robot in team:
            schedule[robot].append(task)
            free[robot] = start + instance.tasks[task].duration
            place[robot] = instance.tasks[task].position
    return schedule
