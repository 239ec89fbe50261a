"""From a schedule to what its page shows: what each robot does, span by span."""

from __future__ import annotations

import math
from typing import Any

from innerattn.config.instances import Instance
from innerattn.envs.colours import robot_looks
from innerattn.policies.scripted.planner import Schedule

SCHEMA_VERSION = 1

Span = tuple[str, float, float, int | None]
"""What a robot does (drive, wait, work or home), from when, until when, and for which task."""


def schedule_document(instance: Instance, schedule: Schedule) -> dict[str, Any]:
    """What the page of a schedule shows, as plain values. Units are the instance's.

    Args:
        instance: the robots and tasks.
        schedule: what `innerattn.policies.scripted.planner.simulate` says of it.
    """
    looks = robot_looks(str(sorted(set(robot.skills))) for robot in instance.robots)
    return {
        "schema_version": SCHEMA_VERSION,
        "makespan": schedule.makespan,
        "extent": _extent(instance),
        "robots": [
            {
                "depot": robot.depot,
                "skills": sorted(set(robot.skills)),
                "kind": look.kind,
                "spans": _spans(instance, schedule, index),
            }
            for index, (robot, look) in enumerate(zip(instance.robots, looks, strict=True))
        ],
        "tasks": [
            {
                "position": task.position,
                "skills": task.skills,
                "start": start,
                "end": start + task.duration,
                "robots": [robot for robot, row in enumerate(schedule.tasks) if index in row],
            }
            for index, (task, start) in enumerate(zip(instance.tasks, schedule.starts, strict=True))
        ],
    }


def _spans(instance: Instance, schedule: Schedule, robot: int) -> list[Span]:
    """A robot's spans without a gap, from 0 to its return; waits of no length are left out."""
    place, now = instance.robots[robot].depot, 0.0
    spans: list[Span] = []
    for index in schedule.tasks[robot]:
        task, start = instance.tasks[index], schedule.starts[index]
        x, y = place[0] - task.position[0], place[1] - task.position[1]
        arrival = now + math.sqrt(x * x + y * y) / instance.speed  # rounded as in the simulation
        spans.append(("drive", now, arrival, index))
        if arrival < start:
            spans.append(("wait", arrival, start, index))
        place, now = task.position, start + task.duration
        spans.append(("work", start, now, index))
    if spans:
        spans.append(("home", now, schedule.returns[robot], None))
    return spans


def _extent(instance: Instance) -> tuple[float, float, float]:
    """Left, bottom and side of a square with all places: the unit square where it holds them."""
    places = [robot.depot for robot in instance.robots]
    places += [task.position for task in instance.tasks]
    xs, ys = zip(*places, strict=True)
    if min(*xs, *ys) >= 0 and max(*xs, *ys) <= 1:
        return 0.0, 0.0, 1.0
    side = max(max(xs) - min(xs), max(ys) - min(ys)) or 1.0
    return (min(xs) + max(xs) - side) / 2, (min(ys) + max(ys) - side) / 2, side
