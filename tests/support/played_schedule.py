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


class PlainOrder:
    """Tasks that are given out one by one; of each coalition all are tried."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        self.schedule: list[list[int]] = [[] for _ in instance.robots]
        self.free = [0.0] * len(instance.robots)
        self.place = [robot.depot for robot in instance.robots]
        self.open = list(range(len(instance.tasks)))
        self.makespan = 0.0

    def coalition(self, task: int) -> tuple[float, tuple[int, ...]]:
        """When a task could begin now, and with whom.

        Of coalitions that begin equally soon it takes the robots that come last, the way home
        counted 1.01 times against them.
        """
        there = self.instance.tasks[task].position
        arrival = [
            free + travel(self.instance, place, there)
            for free, place in zip(self.free, self.place, strict=True)
        ]
        rank = [
            arrival[robot] - 1.01 * travel(self.instance, described.depot, there)
            for robot, described in enumerate(self.instance.robots)
        ]
        teams = itertools.combinations(range(len(self.free)), len(self.instance.tasks[task].skills))
        found = [
            (
                max(arrival[robot] for robot in team),
                sorted((-rank[robot], robot) for robot in team),
                team,
            )
            for team in teams
            if can_do(self.instance, task, team)
        ]
        start, _, team = min(found)
        return start, team

    def take(self, task: int) -> None:
        """Give out a task."""
        start, team = self.coalition(task)
        self.open.remove(task)
        end, there = start + self.instance.tasks[task].duration, self.instance.tasks[task].position
        for robot in team:
            self.schedule[robot].append(task)
            self.free[robot], self.place[robot] = end, there
            home = travel(self.instance, self.instance.robots[robot].depot, there)
            self.makespan = max(self.makespan, end + home)


def made_greedily(instance: Instance) -> list[list[int]]:
    """The schedule of `greedy`: always the task that can begin soonest."""
    order = PlainOrder(instance)
    while order.open:
        order.take(min(order.open, key=lambda task: (order.coalition(task)[0], task)))
    return order.schedule
