"""Which worlds frames can turn, and what turns in their observations."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from innerattn.config import RangeSensor, Robot, Scenario
from innerattn.errors import ConfigError
from innerattn.nn import NUM_ELEMENTS, SquareSymmetry, VectorColumns
from innerattn.train.columns import vector_columns


def turning_columns(scenario: Scenario, names: Sequence[str]) -> VectorColumns:
    """The columns that turn with worlds of a scenario.

    Raises:
        ConfigError: What has a place makes a turned world another one, which no robot could see, or
            rays of robots are not those of a turned world.
    """
    found = _hindrance(scenario)
    if found is not None:
        key, what = found
        raise ConfigError(
            f"scenario.{key}: network.symmetry must be 'none' where {what}; "
            "--network.symmetry none sets it, or take another budget"
        )
    return vector_columns(names, _ray_turns(scenario))


def square_symmetry(
    scenario: Scenario, names: Sequence[str], device: torch.device
) -> SquareSymmetry | None:
    """The group for observations of these columns; None where worlds do not have its symmetry."""
    if _hindrance(scenario) is not None:
        return None
    return SquareSymmetry(vector_columns(names, _ray_turns(scenario)), device)


def _hindrance(scenario: Scenario) -> tuple[str, str] | None:
    """The first key because of which frames cannot turn worlds, and what it says."""
    place = _place(scenario)
    if place is not None:
        key, what = place
        return key, f"{what}, because a turned world would be another one"
    sensing = _sensing(scenario)
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
    area = scenario.victim_area_m
    if area is not None and len({-area[0], -area[1], area[2], area[3]}) > 1:
        return "victim_area_m", "the area is no square around the centre"
    return None


def _sensing(scenario: Scenario) -> list[tuple[int, Robot, RangeSensor]]:
    robots = enumerate(scenario.robots)
    return [(at, one, one.range_sensor) for at, one in robots if one.range_sensor is not None]


def _ray_turns(scenario: Scenario) -> tuple[tuple[int, ...], ...]:
    """Which ray reads, for each element of the group, what each ray reads in a turned world.

    All sensors are alike. Rays from a heading turn with it, and change sides in a mirrored world.
    """
    sensing = _sensing(scenario)
    if not sensing:
        return ()
    _, robot, sensor = sensing[0]
    count = sensor.rays
    turns = []
    for element in range(NUM_ELEMENTS):
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
