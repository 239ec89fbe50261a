"""Worlds as tables of robots and of victims, without names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

ENDLESS_S = 1e3
"""Time until a victim without a deadline is lost [s]."""


class TeamTables(NamedTuple):
    """B worlds with up to R robots, V victims and K abilities each; zeros where there is none.

    Attributes:
        is_robot: (B, R) bool, which rows are robots.
        is_there: (B, R) bool, which of them are in the arena.
        positions: (B, R, 2) [m].
        velocities: (B, R, 2) [m/s].
        bodies: (B, R, 6) final speed at full drive [m/s], the time that a start from rest costs
            against it [s], what one control period of full drive adds to the speed [m/s], the share
            of its speed that a robot keeps from one period to the next, its speed limit [m/s], and
            how long it moves on at a speed, if it coasts after one period [s].
        abilities: (B, R, K), 1 where an available robot has the ability, else 0.
        is_victim: (B, V) bool, which rows are victims.
        places: (B, V, 2) [m].
        needs: (B, V, K), how many robots with each ability a victim needs.
        waits: (B, V, 3) service that a victim still needs [s], time until it is lost [s], or
            `ENDLESS_S`, and 1 if it is blocked, else 0.
        demand: (B, K), how many a victim needs on average over the tasks.
        worlds: (B, 3) half the side of the arena [m], rescue radius [m], most victims at a time.
    """

    is_robot: Tensor
    is_there: Tensor
    positions: Tensor
    velocities: Tensor
    bodies: Tensor
    abilities: Tensor
    is_victim: Tensor
    places: Tensor
    needs: Tensor
    waits: Tensor
    demand: Tensor
    worlds: Tensor


_SIZES = {
    "is_robot": "R",
    "is_there": "R",
    "positions": "R2",
    "velocities": "R2",
    "bodies": "R6",
    "abilities": "RK",
    "is_victim": "V",
    "places": "V2",
    "needs": "VK",
    "waits": "V3",
    "demand": "K",
    "worlds": "3",
}
"""Dimensions of each tensor after the first; those that are letters differ between teams."""


def joined_tables(tables: Sequence[TeamTables]) -> TeamTables:
    """Worlds of several teams as one batch, filled up with zeros to the largest of each size."""
    if len(tables) == 1:
        return tables[0]
    most = {
        "R": max(one.positions.shape[1] for one in tables),
        "V": max(one.places.shape[1] for one in tables),
        "K": max(one.demand.shape[1] for one in tables),
    }
    joined = {}
    for name, letters in _SIZES.items():
        parts = []
        for one in tables:
            part: Tensor = getattr(one, name)
            fill = []
            for letter, size in zip(reversed(letters), reversed(part.shape), strict=False):
                fill += [0, most.get(letter, size) - size]
            parts.append(functional.pad(part, fill) if any(fill) else part)
        joined[name] = torch.cat(parts)
    return TeamTables(**joined)
