"""What networks may be kept from knowing: what is worked out beforehand, and bodies.

A column that is hidden is 0 for a network, and so are its first weights. They stay 0, so that an
exported network need not know what was hidden.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import torch

from innerattn.nn.teams.relations import Relations

Features = Literal["all", "plain"]
Bodies = Literal["told", "hidden", "hypernetwork"]
Columns = Mapping[str, tuple[int, ...]]
"""Numbers of columns, by the name of the table in `Relations`."""
WORKED_OUT: Columns = {
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
"""Arrival times, what follows from them, and from the law of motion. Places, velocities, distances,
bodies, needs and abilities are none of them; nor are counts of robots and victims that follow from
abilities alone, and services, deadlines and orders."""
BODIES: Columns = {"pairs": (9, 10), "homes": (0, 1, 2)}
"""How fast robots are, how long they take to start, and what a push changes."""


def hidden_columns(features: Features, bodies: Bodies) -> Columns:
    """What an actor does not see."""
    found = dict(WORKED_OUT) if features == "plain" else {}
    if bodies != "told":
        for name, columns in BODIES.items():
            found[name] = (*found.get(name, ()), *columns)
    return found


def without(seen: Relations, hidden: Columns) -> Relations:
    """The same with zeros in hidden columns."""
    tables = seen._asdict()
    found = {
        name: tables[name].index_fill(1, torch.tensor(columns), 0.0)
        for name, columns in hidden.items()
    }
    return seen._replace(**found) if found else seen
