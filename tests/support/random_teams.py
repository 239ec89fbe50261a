"""Tables of random teams and worlds, for networks that serve any team."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.nn.teams import TeamTables


class Size(NamedTuple):
    """How many worlds, robots, victim slots and abilities."""

    worlds: int = 5
    robots: int = 4
    victims: int = 3
    abilities: int = 3


def random_tables(size: Size, seed: int) -> TeamTables:
    """Worlds with victims anywhere, some of them within the rescue radius of robots."""
    draw = torch.Generator().manual_seed(seed)

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return torch.rand(shape, generator=draw) * (high - low) + low

    worlds, robots, victims, abilities = size
    is_victim = uniform(0.0, 1.0, worlds, victims) < 0.8
    is_victim[0] = False  # a world in which nobody waits
    needs = (torch.rand(worlds, victims, abilities, generator=draw) * 2.6).floor()
    return TeamTables(
        is_robot=torch.ones(worlds, robots, dtype=torch.bool),
        is_there=torch.ones(worlds, robots, dtype=torch.bool),
        positions=uniform(-0.6, 0.6, worlds, robots, 2),
        velocities=uniform(-0.7, 0.7, worlds, robots, 2),
        bodies=uniform(0.3, 1.5, worlds, robots, 6),
        abilities=(uniform(0.0, 1.0, worlds, robots, abilities) < 0.6).float(),
        is_victim=is_victim,
        places=uniform(-0.6, 0.6, worlds, victims, 2) * is_victim[..., None],
        needs=needs * is_victim[..., None],
        demand=uniform(0.1, 1.5, worlds, abilities),
        worlds=torch.tensor([[1.0, 0.15, float(victims)]]).expand(worlds, -1),
    )
