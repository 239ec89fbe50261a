"""Spare robots: they wait outside of an arena until somebody lets them in."""

from __future__ import annotations

from innerattn.config import Fault, Scenario
from innerattn.config.scenario import Robot
from innerattn.errors import ConfigError

MOST_ROBOTS = 64
"""Most robots of a world."""

USUAL_SPARES = 2
"""Spare robots of each kind, where nobody says how many and there is room for them."""

_MOST_LETTERS = 64


def with_spares(scenario: Scenario, each: int) -> Scenario:
    """The same worlds with spare robots, which are not in the arena when an episode starts.

    They stand behind the scenario's own robots in all lists. Each is a copy of the first robot of
    its kind, but starts at a random place. Unavailable robots leave the arena.

    Args:
        scenario: the worlds.
        each: how many of each kind, 0 or more; 0: the scenario as it is.

    Raises:
        ConfigError: robots would be too many or have no room, or unavailable robots of the
            scenario stay in the arena.
    """
    if each == 0:
        return scenario
    if not scenario.robots_leave and any(one.kind == "unavailable" for one in scenario.faults):
        raise ConfigError(
            "scenario.unavailable_robots = 'stay': must be 'leave' for robots to be added, because "
            "scenario.faults make robots unavailable"
        )
    taken = {robot.name for robot in scenario.robots}
    first_of: dict[str, Robot] = {}
    for robot in scenario.robots:
        first_of.setdefault(robot.kind, robot)
    spares = [_copied(one, taken) for one in first_of.values() for _ in range(each)]
    outside = [Fault(robot=one.name, kind="unavailable", value=1.0) for one in spares]
    return scenario.replace(
        robots=(*scenario.robots, *spares),
        faults=(*scenario.faults, *outside),
        unavailable_robots="leave",
    )


def with_usual_spares(scenario: Scenario) -> Scenario:
    """The same worlds with `USUAL_SPARES` of each kind, or as many as there is room for.

    See `with_spares`. Where unavailable robots of the scenario stay, there are none.
    """
    kinds = len({robot.kind for robot in scenario.robots})
    for each in range(min(USUAL_SPARES, (MOST_ROBOTS - scenario.num_robots) // kinds), 0, -1):
        try:
            return with_spares(scenario, each)
        except ConfigError:
            continue
    return scenario


def _copied(robot: Robot, taken: set[str]) -> Robot:
    """A robot like another one under the next free name, which is ``taken`` from now on."""
    number = 0
    while (name := f"{robot.kind[: _MOST_LETTERS - 3]}_{number}") in taken:
        number += 1
    taken.add(name)
    return robot.model_copy(update={"name": name, "start_m": None})
