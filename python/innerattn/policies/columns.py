"""What the columns of an observation are, found out from their names; without torch.

`innerattn.train.columns` has what training needs beside. Names are as the worlds give them.
"""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.envs.entities import EntityLayout
from innerattn.policies.exported.contract import Entities, FrameColumns

HANDED = (".fault.heading_bias", ".turn_rate", ".left")
"""Ends of names of columns that change their sign in a mirrored world."""


def able_columns(names: Sequence[str]) -> tuple[int, ...]:
    """The columns that are all above 0 where a robot can act: it is available and has charge."""
    return tuple(names.index(one) for one in ("own.available", "own.charge") if one in names)


def entity_columns(names: Sequence[str]) -> Entities:
    """How many columns the robot itself, each teammate and each victim have."""
    return Entities(**EntityLayout.of(names).numbers())


def frame_columns(
    names: Sequence[str], ray_turns: tuple[tuple[int, ...], ...] = ()
) -> FrameColumns:
    """The columns that turn with the world, and those that choose the frame.

    Args:
        names: of all columns.
        ray_turns: how rays turn, as of `innerattn.config.turning.ray_turns`.
    """
    place = {name: column for column, name in enumerate(names)}
    stems = [name.removesuffix(".x") for name in names if name.endswith(".x")]
    pairs = {stem: (place[f"{stem}.x"], place[f"{stem}.y"]) for stem in stems}
    anchors = [stem for stem in stems if stem.startswith("victim_")]
    anchors += ["own.position", "own.velocity"]
    if "teammate_0.seen" in place:
        teammates = [stem for stem in stems if stem.startswith("teammate_")]
        anchors += ["own.heading", *(stem for stem in teammates if stem.endswith("_position"))]
    return FrameColumns(
        vectors=tuple(pairs.values()),
        handed=tuple(place[name] for name in names if name.endswith(HANDED)),
        anchors=tuple(pairs[stem] for stem in anchors if stem in pairs),
        rays=tuple(place[name] for name in names if name.startswith("own.ray.")),
        ray_turns=ray_turns,
    )
