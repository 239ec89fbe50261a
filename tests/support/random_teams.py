"""Tables of random teams and worlds, for networks that serve any team."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.nn.teams import TeamTables
from innerattn.nn.teams.tables import ENDLESS_S


class Size(NamedTuple):
    """How many worlds, robots, victim slots and abilities."""

    worlds: int = 5
    robots: int = 4
    victims: int = 3
    abilities: int = 3


def _waits(uniform: Callable[..., Tensor], *sizes: int) -> Tensor:
    """Of half of the victims each: a service, a deadline, and that they are blocked."""
    has = uniform(0.0, 1.0, *sizes, 3) < 0.5
    service, left, blocked = has.unbind(-1)
    return torch.stack(
        [
            service * uniform(0.1, 5.0, *sizes),
            torch.where(left, uniform(0.0, 9.0, *sizes), ENDLESS_S),
            blocked.float(),
        ],
        -1,
    )


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
        waits=_waits(uniform, worlds, victims) * is_victim[..., None],
        demand=uniform(0.1, 1.5, worlds, abilities),
        worlds=torch.tensor([[1.0, 0.15, float(victims)]]).expand(worlds, -1),
    )
