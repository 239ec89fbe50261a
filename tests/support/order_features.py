"""What is known of a task that could come next in an order, by plain code: nothing here is fast."""

from __future__ import annotations

from collections.abc import Iterable

from played_schedule import PlainOrder, travel

from innerattn.config.instances import Instance


def mean(values: Iterable[float]) -> float:
    """Of some numbers; 0 of none."""
    kept = list(values)
    return sum(kept) / len(kept) if kept else 0.0


def unit_of(instance: Instance) -> float:
    """The mean duration, and the mean way to a task from all depots and tasks."""
    places = [robot.depot for robot in instance.robots]
    places += [task.position for task in instance.tasks]
    ways = [travel(instance, place, task.position) for task in instance.tasks for place in places]
    return mean(task.duration for task in instance.tasks) + mean(ways) or 1.0


def plain_features(order: PlainOrder, task: int) -> list[float]:
    """The 18 numbers, in the order of `_core.Orders.features`."""
    instance, it = order.instance, order.instance.tasks[task]
    now = mean(order.free)
    starts = {one: order.coalition(one)[0] for one in order.open}
    start, team = order.coalition(task)
    way = {robot: travel(instance, order.place[robot], it.position) for robot in team}
    homes = [travel(instance, instance.robots[robot].depot, it.position) for robot in team]
    others = [
        travel(instance, instance.tasks[other].position, it.position)
        for other in order.open
        if other != task
    ]
    work, ready = _waiting(order)
    end = start + it.duration
    times = [
        start - min(starts.values()),
        start - now,
        it.duration,
        mean(way.values()),
        mean(start - order.free[robot] - way[robot] for robot in team),
        max(homes),
        mean(homes),
        end + max(homes) - order.makespan,
        min(others, default=0.0),
        mean(others),
        max(work[skill] for skill in it.skills),
        mean(work[skill] for skill in it.skills),
        max(ready[skill] + work[skill] for skill in it.skills) - now,
        now - min(order.free),
        mean(value for value in work.values() if value > 0),
        order.makespan - now,
    ]
    unit = unit_of(instance)
    most = max(len(one.skills) for one in instance.tasks)
    done = len(instance.tasks) - len(order.open)
    return [time / unit for time in times] + [len(it.skills) / most, done / len(instance.tasks)]


def _waiting(order: PlainOrder) -> tuple[dict[int, float], dict[int, float]]:
    """For each skill, work that waits for each robot that has it, and when these are free."""
    instance = order.instance
    work: dict[int, float] = {}
    for task in order.open:
        it = instance.tasks[task]
        way = mean(
            travel(instance, instance.tasks[other].position, it.position) for other in order.open
        )
        for skill in it.skills:
            able = sum(skill in robot.skills for robot in instance.robots)
            work[skill] = work.get(skill, 0.0) + (it.duration + way) / able
    ready = {
        skill: mean(
            free
            for free, robot in zip(order.free, instance.robots, strict=True)
            if skill in robot.skills
        )
        for skill in range(32)
    }
    return work, ready
