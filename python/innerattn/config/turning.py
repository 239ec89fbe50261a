"""Which worlds frames can turn and mirror (`network.symmetry`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from innerattn.config.range_sensor import RangeSensor
from innerattn.config.run import RunConfig
from innerattn.config.scenario import Robot, Scenario
from innerattn.config.task import Arrival
from innerattn.errors import ConfigError

_ELEMENTS = 8
"""Turns and mirrors of the square; see `innerattn.nn.symmetry`."""


def check_frames(config: RunConfig) -> None:
    """Refuse a run whose frames cannot turn its worlds.

    Raises:
        ConfigError: the message names the key of the scenario.
    """
    if config.network.symmetry != "none" and not config.algorithm.for_any_team:
        check_turning(config.scenario)


def check_turning(scenario: Scenario) -> None:
    """Refuse worlds that frames cannot turn.

    Raises:
        ConfigError: What has a place makes a turned world another one, which no robot could see, or
            rays of robots are not those of a turned world.
    """
    found = turning_hindrance(scenario)
    if found is not None:
        key, what = found
        raise ConfigError(
            f"scenario.{key}: network.symmetry must be 'none' where {what}; "
            "--network.symmetry none sets it, or take another budget"
        )


def turning_hindrance(scenario: Scenario) -> tuple[str, str] | None:
    """The first key because of which frames cannot turn worlds, and what it says."""
    place = _place(scenario)
    if place is not None:
        key, what = place
        return key, f"{what}, because a turned world would be another one"
    sensing = range_sensors(scenario)
    for index, robot, sensor in sensing:
        key = f"robots[{index}].range_sensor"
        _, first, other = sensing[0]
        alike = (sensor.rays, sensor.field_of_view_deg) == (other.rays, other.field_of_view_deg)
        if not alike or robot.has_wheels != first.has_wheels:
            return key, "range sensors differ, in rays or field of view, or in having a heading"
        if not robot.has_wheels and sensor.rays % 4:
            return f"{key}.rays", "rays of robots without a heading are no multiple of 4"
    return None


def _place(scenario: Scenario) -> tuple[str, str] | None:
    """The first key that gives something a place, and what it says."""
    for index, obstacle in enumerate(scenario.obstacles):
        sides = obstacle.half_extents_m
        if obstacle.position_m is not None or (sides is not None and sides[0] != sides[1]):
            return f"obstacles[{index}]", "an obstacle has a fixed place or is an oblong box"
    if scenario.map is not None:
        return "map", "solid cells have fixed places"
    for index, robot in enumerate(scenario.robots):
        if robot.start_m is not None:
            return f"robots[{index}].start_m", "a robot has a fixed start"
    if scenario.victim_places_m:
        return "victim_places_m", "victims have fixed places"
    lonely = _first_without_images(scenario.arrivals)
    if lonely is not None:
        what = "a victim arrives at a place alone, not at all that turns and mirrors make of it"
        return f"arrivals[{lonely}].position_m", what
    for index, task in enumerate(scenario.tasks):
        x_low, y_low, x_high, y_high = scenario.area_of(task)
        if len({-x_low, -y_low, x_high, y_high}) > 1:
            key = "victim_area_m" if task.area_m is None else f"tasks[{index}].area_m"
            return key, "the area is no square around the centre"
    return None


def _first_without_images(arrivals: Sequence[Arrival]) -> int | None:
    """Index of the first arrival that a turned or mirrored world would not have; None: no such."""
    each = Counter((one.at_s, one.task, *one.position_m) for one in arrivals)
    for index, one in enumerate(arrivals):
        x, y = one.position_m
        images = {
            (one.at_s, one.task, *image)
            for across in (x, -x)
            for up in (y, -y)
            for image in ((across, up), (up, across))
        }
        if len({each[image] for image in images}) > 1:
            return index
    return None


def range_sensors(scenario: Scenario) -> list[tuple[int, Robot, RangeSensor]]:
    """Robots with a range sensor, with their indices."""
    robots = enumerate(scenario.robots)
    return [(at, one, one.range_sensor) for at, one in robots if one.range_sensor is not None]


def ray_turns(scenario: Scenario) -> tuple[tuple[int, ...], ...]:
    """Which ray reads, for each element of the group, what each ray reads in a turned world.

    All sensors are alike; nothing where there are none. Rays from a heading turn with it, and
    change sides in a mirrored world.
    """
    sensing = range_sensors(scenario)
    if not sensing:
        return ()
    _, robot, sensor = sensing[0]
    count = sensor.rays
    turns = []
    for element in range(_ELEMENTS):
        rays = list(range(count))
        if robot.has_wheels:
            fan = sensor.field_of_view_deg < 360.0
            mirrored = [count - 1 - ray if fan else -ray % count for ray in rays]
            rays = mirrored if element.bit_count() % 2 else rays
        else:  # back to the world as it was: first the swap of x and y, then the mirrors
            rays = [(count // 4 - ray) % count for ray in rays] if element & 4 else rays
            rays = [(count // 2 - ray) % count for ray in rays] if element & 1 else rays
            rays = [-ray % count for ray in rays] if element & 2 else rays
        turns.append(tuple(rays))
    return tuple(turns)
