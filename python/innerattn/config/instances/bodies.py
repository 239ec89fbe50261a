"""From an instance of points to a world in which its robots have bodies and inertia."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, Literal

from innerattn.config.instances.instance import Instance, Place
from innerattn.config.scenario import Scenario
from innerattn.errors import ConfigError

Engine = Literal["none", "discs", "rapier"]

RADIUS_M = 0.01
"""Of a robot, where all places lie in a square with a side of 2 m."""
REACH_M = 0.03
"""How near helpers must be: eight bodies find room around a task."""
DT_S = 0.05
_HALF_M = 1.0
_MARGIN_M = 0.1
_MOST_TASKS = 32
_ROUNDS = 6  # places of bodies on a ring around a depot


def world_of(instance: Instance, engine: Engine, most_s: float) -> Scenario:
    """The world of an instance: its square is scaled to a side of 2 m, and its times are seconds.

    Each task is a victim of its own type, with a service. With contacts, robots reach their speed
    in three control periods, and those that share a depot start around it; without, they have their
    speed at once.

    Args:
        instance: robots and tasks; at most 32 tasks.
        engine: contacts, or none.
        most_s: when the time is up [s].

    Raises:
        ConfigError: there are too many tasks, or the world cannot have its values.
    """
    if len(instance.tasks) > _MOST_TASKS:
        raise ConfigError(
            f"{instance.name}: {len(instance.tasks)} tasks: a world has at most {_MOST_TASKS}"
        )
    scale, (x0, y0) = _frame(instance)

    def metres(place: Place) -> Place:
        return (place[0] - x0) * scale, (place[1] - y0) * scale

    speed = instance.speed * scale
    inert = engine != "none"
    values: dict[str, Any] = {
        "situation": "listed",
        "actions": "continuous",
        "engine": engine,
        "max_victims": 1,
        "arena_half_width_m": _HALF_M + _MARGIN_M,
        "wall_clearance_m": 0.0,
        "rescue_radius_m": REACH_M,
        "dt_s": DT_S,
        "damping": 0.25 if inert else 0.0,
        "episode_steps": math.ceil(most_s / DT_S),
        "robots": [
            {
                "name": f"robot_{index}",
                "kind": "_".join(_abilities(robot.skills)) or "none",
                "abilities": _abilities(robot.skills),
                "max_speed_mps": speed,
                "mass_kg": 1.0,
                "radius_m": RADIUS_M,
                "drive_force_n": speed * (0.5 if inert else 2.0) / DT_S,
                "start_m": start,
            }
            for index, (robot, start) in enumerate(
                zip(instance.robots, _starts(instance, metres, inert), strict=True)
            )
        ],
        "tasks": [
            {
                "name": f"task_{index}",
                "needs": [f"s{skill}" for skill in task.skills],
                "service_s": task.duration,
            }
            for index, task in enumerate(instance.tasks)
        ],
        "arrivals": [
            {"at_s": 0.0, "task": f"task_{index}", "position_m": metres(task.position)}
            for index, task in enumerate(instance.tasks)
        ],
    }
    try:
        return Scenario().replace(**values)
    except ConfigError as error:
        raise ConfigError(f"{instance.name}: cannot be played in a world: {error}") from error


def _abilities(skills: tuple[int, ...]) -> list[str]:
    """Short names, which fit into the marks of a page."""
    return [f"s{skill}" for skill in sorted(set(skills))]


def _frame(instance: Instance) -> tuple[float, Place]:
    """Metres of a unit, and the middle of all places."""
    places = [robot.depot for robot in instance.robots]
    places += [task.position for task in instance.tasks]
    xs, ys = zip(*places, strict=True)
    side = max(max(xs) - min(xs), max(ys) - min(ys)) or 1.0
    return 2.0 * _HALF_M / side, ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)


def _starts(instance: Instance, metres: Any, apart: bool) -> list[Place]:
    """Where robots start [m]: at their depots, and with bodies on rings around shared ones."""
    here: Counter[Place] = Counter()
    starts = []
    for robot in instance.robots:
        x, y = metres(robot.depot)
        number = here[robot.depot]
        here[robot.depot] += 1
        if apart and number:
            ring, turn = 1 + (number - 1) // _ROUNDS, (number - 1) % _ROUNDS
            angle = 2.0 * math.pi * (turn / _ROUNDS + ring / 12)
            x += 2.5 * RADIUS_M * ring * math.cos(angle)
            y += 2.5 * RADIUS_M * ring * math.sin(angle)
        starts.append((x, y))
    return starts
