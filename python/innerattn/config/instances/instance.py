"""One instance: robots that travel at constant speed, and tasks that they do together.

A task needs a robot for each of its skills, all present at the same time for its duration. Robots
are points; they begin at their depots and return there.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from innerattn import _core
from innerattn.config.model import Model

NAME = r"^[\w.-]{1,64}$"
"""What names of instances look like."""

Place = tuple[float, float]
Skill = Annotated[int, Field(ge=0, le=31)]


class InstanceRobot(Model):
    """A robot: where it begins and ends, and the numbers of its skills; it uses one at a time."""

    depot: Place
    skills: tuple[Skill, ...]


class InstanceTask(Model):
    """A task: its place, a skill for each robot that it needs, and how long they work on it."""

    position: Place
    skills: tuple[Skill, ...]
    duration: float


class Instance(Model):
    """Robots, tasks, and what others found for them. Units are those of whoever published it.

    Raises:
        pydantic.ValidationError: (a `ValueError`) unknown key, wrong type, value out of range, or
            a task that no robots of the team can do; the message names the robot or task.
    """

    name: Annotated[str, Field(pattern=NAME)]
    speed: float
    robots: tuple[InstanceRobot, ...]
    tasks: tuple[InstanceTask, ...]
    makespan_milp_600s: Annotated[float, Field(gt=0)] | None = None
    """Makespan that its authors' mixed-integer program found in 600 s, the way home included."""
    lower_bound_milp: Annotated[float, Field(ge=0)] | None = None
    """No schedule is shorter, as the same program found."""

    def model_post_init(self, _context: object, /) -> None:
        """Check the values and that the team can do every task."""
        try:
            self.compiled()
        except ValueError as error:
            raise ValueError(f"{self.name}.{error}") from error

    def compiled(self) -> _core.Instance:
        """This instance as the compiled module plans for it."""
        return _core.Instance(
            self.speed,
            [(robot.depot, robot.skills) for robot in self.robots],
            [(task.position, task.skills, task.duration) for task in self.tasks],
        )
