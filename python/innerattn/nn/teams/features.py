"""Which columns are worked out: arrival times, and what follows from them."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from innerattn.nn.teams.relations import Relations

WORKED_OUT: Mapping[str, tuple[int, ...]] = {
    # Times, met needs, spare robots, ranks, rivals and partners in time, and time to spare.
    "pairs": (1, 5, 7, 8, 14, 15, 17, 18, 19, 20, 26),
    # The way to the soonest other victim, and what actions gain on the way to this one.
    "turning": tuple(range(8, 19)),
    # The soonest victim, how much abilities are asked for, and gains on the way to the centre.
    "homes": (6, 8, 9, *range(16, 25)),
    "victims": (0, 1, 2, 4, 5, 11),
    "team": (6, 8, 9),
    "worlds": (5,),
}
"""Columns of `Relations`, by the name of the table."""


def plain(seen: Relations) -> Relations:
    """The same with zeros where columns are worked out.

    Places, velocities, distances, bodies, needs and abilities stay; so do counts of robots and
    victims that follow from abilities alone, and services, deadlines and orders.
    """
    tables = seen._asdict()
    found = {
        name: tables[name].index_fill(1, torch.tensor(columns), 0.0)
        for name, columns in WORKED_OUT.items()
    }
    return seen._replace(**found)
