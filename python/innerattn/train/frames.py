"""What turns in observations of worlds that frames can turn."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from innerattn.config import Scenario
from innerattn.config.turning import check_turning, range_sensors, turning_hindrance
from innerattn.nn import NUM_ELEMENTS, SquareSymmetry, VectorColumns
from innerattn.train.columns import vector_columns


def turning_columns(scenario: Scenario, names: Sequence[str]) -> VectorColumns:
    """The columns that turn with worlds of a scenario.

    Raises:
        ConfigError: What has a place makes a turned world another one, which no robot could see, or
            rays of robots are not those of a turned world.
    """
    check_turning(scenario)
    return vector_columns(names, _ray_turns(scenario))


def square_symmetry(
    scenario: Scenario, names: Sequence[str], device: torch.device
) -> SquareSymmetry | None:
    """The group for observations of these columns; None where worlds do not have its symmetry."""
    if turning_hindrance(scenario) is not None:
        return None
    return SquareSymmetry(vector_columns(names, _ray_turns(scenario)), device)


def _ray_turns(scenario: Scenario) -> tuple[tuple[int, ...], ...]:
    """Which ray reads, for each element of the group, what each ray reads in a turned world.

    All sensors are alike. Rays from a heading turn with it, and change sides in a mirrored world.
    """
    sensing = range_sensors(scenario)
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
