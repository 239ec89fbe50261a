"""What turns in observations of worlds that frames can turn."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from innerattn.config import Scenario
from innerattn.config.turning import check_turning, ray_turns, turning_hindrance
from innerattn.nn import SquareSymmetry, VectorColumns
from innerattn.train.columns import vector_columns


def turning_columns(scenario: Scenario, names: Sequence[str]) -> VectorColumns:
    """The columns that turn with worlds of a scenario.

    Raises:
        ConfigError: What has a place makes a turned world another one, which no robot could see, or
            rays of robots are not those of a turned world.
    """
    check_turning(scenario)
    return vector_columns(names, ray_turns(scenario))


def square_symmetry(
    scenario: Scenario, names: Sequence[str], device: torch.device
) -> SquareSymmetry | None:
    """The group for observations of these columns; None where worlds do not have its symmetry."""
    if turning_hindrance(scenario) is not None:
        return None
    return SquareSymmetry(vector_columns(names, ray_turns(scenario)), device)
