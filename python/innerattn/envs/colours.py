"""Colours of robots: one for each kind, the same in every figure and page."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

KIND_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#F0E442")
"""Of Okabe & Ito's palette, told apart with every common colour blindness; beyond, they repeat."""


class RobotLook(NamedTuple):
    """How a robot is drawn.

    Attributes:
        kind: number of its kind in the team.
        twin: how many robots of its kind come before it; a dash tells twins apart.
    """

    kind: int
    twin: int

    @property
    def colour(self) -> str:
        """Of its kind, as #RRGGBB."""
        return KIND_COLOURS[self.kind % len(KIND_COLOURS)]


def robot_looks(kinds: Iterable[str]) -> list[RobotLook]:
    """How the robots of a team are drawn, from their kinds in the team's order."""
    seen: dict[str, int] = {}
    looks = []
    for kind in kinds:
        twin = seen[kind] = seen.get(kind, -1) + 1
        looks.append(RobotLook(list(seen).index(kind), twin))
    return looks
