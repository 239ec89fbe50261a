"""Random instances of one sort, to learn from: each skill has a depot and some robots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from innerattn.config.instances.instance import Instance, InstanceRobot, InstanceTask
from innerattn.errors import ConfigError

MOST_SKILLS, MOST_ROBOTS, MOST_TASKS = 32, 64, 500


@dataclass(frozen=True, kw_only=True)
class InstanceSort:
    """What random instances have in common; the defaults are those of the set ``ral``.

    Depots and tasks lie anywhere in the unit square.

    Attributes:
        skills: how many; robots have one each.
        robots_per_skill: how many robots share a depot and a skill.
        tasks: fewest and most; an instance has any number between them.
        need_share: how likely a task needs a skill; each needs at least one.
        most_duration: the longest task; durations are uniform from 0.
        speed: of all robots.

    Raises:
        ConfigError: a value is out of range.
    """

    skills: int = 5
    robots_per_skill: int = 3
    tasks: tuple[int, int] = (20, 20)
    need_share: float = 0.5
    most_duration: float = 5.0
    speed: float = 0.2

    def __post_init__(self) -> None:
        fewest, most = self.tasks
        robots = self.skills * self.robots_per_skill
        for name, value, low, high in (
            ("skills", self.skills, 1, MOST_SKILLS),
            ("skills times robots_per_skill", robots, 1, MOST_ROBOTS),
            ("tasks: the fewest", fewest, 1, MOST_TASKS),
            ("tasks: the most", most, fewest, MOST_TASKS),
            ("need_share", self.need_share, 1e-3, 1.0),
            ("most_duration", self.most_duration, 0.0, 1e6),
            ("speed", self.speed, 1e-6, 1e6),
        ):
            if not low <= value <= high:
                raise ConfigError(f"{name} = {value}: must be {low} to {high}")


def draw_instance(sort: InstanceSort, draws: np.random.Generator) -> Instance:
    """A random instance.

    Args:
        sort: of which sort.
        draws: where it comes from.
    """
    depots = draws.random((sort.skills, 2)).tolist()
    robots = [
        InstanceRobot(depot=tuple(depot), skills=(skill,))
        for skill, depot in enumerate(depots)
        for _ in range(sort.robots_per_skill)
    ]
    count = int(draws.integers(sort.tasks[0], sort.tasks[1], endpoint=True))
    tasks = [
        InstanceTask(
            position=tuple(draws.random(2).tolist()),
            skills=_needs(sort, draws),
            duration=float(draws.random() * sort.most_duration),
        )
        for _ in range(count)
    ]
    return Instance(name="drawn", speed=sort.speed, robots=tuple(robots), tasks=tuple(tasks))


def _needs(sort: InstanceSort, draws: np.random.Generator) -> tuple[int, ...]:
    """Skills of a task, drawn until there is one."""
    while True:
        needed = np.flatnonzero(draws.random(sort.skills) < sort.need_share)
        if needed.size:
            return tuple(needed.tolist())
