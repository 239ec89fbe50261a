"""Rows of observations as tables: the robot itself, its teammates and the victims."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_YES = 0.5


class Entities(NamedTuple):
    """What robots see, entity by entity.

    Rows whose mask is False are zeros, but for what a robot remembers (``since_seen``) or hears
    (``heard``) of what it does not see.

    Attributes:
        own: (..., C) float32, columns of each robot itself.
        teammates: (..., K, C') float32, columns of each of its teammates.
        teammate_mask: (..., K) bool, whom the robot sees; where nothing limits its sight, of whom
            it knows anything.
        victims: (..., V, C'') float32, columns of each victim.
        victim_mask: (..., V) bool, which slots hold a victim that the robot knows.
    """

    own: NDArray[np.float32]
    teammates: NDArray[np.float32]
    teammate_mask: NDArray[np.bool_]
    victims: NDArray[np.float32]
    victim_mask: NDArray[np.bool_]


class EntityLayout(NamedTuple):
    """Which columns a row has of the robot itself, then of its teammates, then of the victims.

    Attributes:
        own: names of the columns of the robot itself, such as ``position.x``.
        teammate: names of the columns of each teammate.
        victim: names of the columns of each victim.
        teammates: number of teammates K.
        victims: number of victims V.
    """

    own: tuple[str, ...]
    teammate: tuple[str, ...]
    victim: tuple[str, ...]
    teammates: int
    victims: int

    @classmethod
    def of(cls, names: Sequence[str]) -> EntityLayout:
        """That of rows whose columns have these names, as `BatchEnv.observation_names` gives them.

        Raises:
            ValueError: names are not those of entities; the message names the first such column.
        """
        quantities: dict[str, list[str]] = {"own": [], "teammate_0": [], "victim_0": []}
        for name in names:
            owner, _, quantity = name.partition(".")
            quantities.setdefault(owner, []).append(quantity)
        own, teammate, victim = (quantities[one] for one in ("own", "teammate_0", "victim_0"))
        teammates = _count(quantities, "teammate_") if teammate else 0
        victims = _count(quantities, "victim_") if victim else 0
        expected = [f"own.{quantity}" for quantity in own]
        expected += [f"teammate_{k}.{quantity}" for k in range(teammates) for quantity in teammate]
        expected += [f"victim_{k}.{quantity}" for k in range(victims) for quantity in victim]
        for place, (found, wanted) in enumerate(zip_longest(names, expected)):
            if found != wanted:
                raise ValueError(f"column {place} of an observation is {found!r}, not {wanted!r}")
        if not own:
            raise ValueError("an observation has no column own.*")
        if "present" not in victim:
            raise ValueError("an observation has no column victim_0.present")
        return cls(tuple(own), tuple(teammate), tuple(victim), teammates, victims)

    def entities(self, rows: NDArray[np.float32]) -> Entities:
        """Observations (..., D) by entity; the tables are views of them, if they are contiguous."""
        own, mates = len(self.own), self.teammates * len(self.teammate)
        teammates = _blocks(rows[..., own : own + mates], self.teammates, len(self.teammate))
        victims = _blocks(rows[..., own + mates :], self.victims, len(self.victim))
        return Entities(
            own=rows[..., :own],
            teammates=teammates,
            teammate_mask=self._known(teammates),
            victims=victims,
            victim_mask=victims[..., self.victim.index("present")] > _YES,
        )

    def _known(self, teammates: NDArray[np.float32]) -> NDArray[np.bool_]:
        if "seen" in self.teammate:
            return teammates[..., self.teammate.index("seen")] > _YES
        # Squares add up three times as fast as `any` finds out, and the least distance of robots
        # is far above the root of the smallest number.
        return np.asarray(np.einsum("...c,...c->...", teammates, teammates) > 0.0)

    def numbers(self) -> dict[str, Any]:
        """How many columns there are and where some of them stand among those of their entity.

        The keys are the fields of `innerattn.nn.EntityColumns`, and of what contracts of exported
        teams say of an encoder by entities.
        """
        return {
            "own": len(self.own),
            "teammates": self.teammates,
            "teammate": len(self.teammate),
            "victims": self.victims,
            "victim": len(self.victim),
            "present": self.victim.index("present"),
            "seen": self.teammate.index("seen") if "seen" in self.teammate else None,
            "teammate_place": _place(self.teammate),
            "victim_place": _place(self.victim),
        }


def joined_names(lists: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """All names of several lists, once each; a name that is new follows the one before it."""
    joined: list[str] = []
    for names in lists:
        place = 0
        for name in names:
            if name not in joined:
                joined.insert(place, name)
            place = joined.index(name) + 1
    return tuple(joined)


def _place(names: tuple[str, ...]) -> tuple[int, int] | None:
    """Where the place of an entity stands, relative to the robot."""
    axes = ("relative_position.x", "relative_position.y")
    if not set(axes) <= set(names):
        return None
    return names.index(axes[0]), names.index(axes[1])


def _blocks(columns: NDArray[Any], count: int, width: int) -> NDArray[Any]:
    return columns.reshape(*columns.shape[:-1], count, width)


def _count(owners: dict[str, list[str]], prefix: str) -> int:
    return sum(owner.startswith(prefix) for owner in owners)
