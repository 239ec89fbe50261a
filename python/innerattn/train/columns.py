"""Finds out from names what columns of an observation are: whose, or turning, or of what."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.envs.entities import EntityLayout
from innerattn.errors import ConfigError
from innerattn.nn import EntityColumns, Hearing, PartnerColumns, VectorColumns
from innerattn.policies.columns import HANDED, frame_columns


def entity_columns(names: Sequence[str]) -> EntityColumns:
    """Numbers of columns of the robot itself, of its teammates and of the victims.

    Args:
        names: Of all columns: ``own.*``, then ``teammate_0.*``, ``teammate_1.*`` and so on, then
            ``victim_0.*`` and so on. All teammates have the same columns, and so have all victims,
            ``victim_k.present`` among them. ``teammate_k.seen`` says whether a teammate is there.

    Raises:
        ConfigError: The names are not of that form; the message names the first column that is not.
    """
    try:
        return EntityColumns(**EntityLayout.of(names).numbers())
    except ValueError as error:
        raise ConfigError(f"network.encoder = 'entities': {error}; must be 'flat' here") from error


def vector_columns(
    names: Sequence[str], ray_turns: tuple[tuple[int, ...], ...] = ()
) -> VectorColumns:
    """Columns that turn with the world: pairs ``*.x`` and ``*.y``, angles, and ways to the left.

    Victims choose the frame, in the order of their slots; then the robot's own place and velocity.
    Where sight is limited, a robot may see no victim: then its heading and its teammates' places
    follow.

    Args:
        names: Of all columns.
        ray_turns: How rays ``own.ray.*`` turn, as `VectorColumns` has it.

    Raises:
        ConfigError: A column ``*.x`` has no ``*.y`` beside it, or there is no ``own.position``.
    """
    place = {name: column for column, name in enumerate(names)}
    stems = [name.removesuffix(".x") for name in names if name.endswith(".x")]
    missing = [stem for stem in stems if f"{stem}.y" not in place]
    if missing or "own.position" not in stems:
        raise ConfigError(
            "network.symmetry = 'canonical' or 'augmented': an observation needs own.position, and "
            f"a column .y for every column .x; {(missing or ['own.position'])[0]} lacks it"
        )
    found = frame_columns(names, ray_turns)
    return VectorColumns(
        width=len(names),
        vectors=found.vectors,
        handed=found.handed,
        anchors=found.anchors,
        rays=found.rays,
        ray_turns=found.ray_turns,
    )


def state_columns(names: Sequence[str]) -> VectorColumns:
    """Columns of a world's state that turn with the world: pairs ``*.x`` and ``*.y``.

    Victims choose the frame, in the order of their slots; then the robots' places and velocities.

    Args:
        names: Of all columns, as `innerattn.envs.BatchEnv.state_names` gives them.
    """
    place = {name: column for column, name in enumerate(names)}
    stems = [name.removesuffix(".x") for name in names if name.endswith(".x")]
    pairs = {stem: (place[f"{stem}.x"], place[f"{stem}.y"]) for stem in stems}
    victims = [pairs[stem] for stem in stems if stem.startswith("victim_")]
    others = [stem for stem in stems if not stem.startswith(("victim_", "obstacle_"))]
    robots = [pairs[stem] for stem in others if not stem.endswith(".heading")]
    return VectorColumns(
        width=len(names),
        vectors=tuple(pairs.values()),
        handed=tuple(place[name] for name in names if name.endswith(HANDED)),
        anchors=(*victims, *robots),
    )


def partner_columns(names: Sequence[str], teammates_in_order: bool = True) -> PartnerColumns:
    """The columns that tell who can help whom: abilities, places, and the first victim's needs.

    Args:
        names: Of all columns, as the worlds name them.
        teammates_in_order: Whether a row has all teammates in team order. If not, the rows of
            the teammates tell where they are and what they can do.
    """
    place = {name: column for column, name in enumerate(names)}
    abilities = [
        name.removeprefix("own.ability.") for name in names if name.startswith("own.ability.")
    ]
    teammates = _teammates(names) if teammates_in_order else []
    own_place = place["own.position.x"], place["own.position.y"]

    def at(who: str) -> tuple[int, int]:
        return place[f"{who}.relative_position.x"], place[f"{who}.relative_position.y"]

    return PartnerColumns(
        abilities=tuple(place[f"own.ability.{one}"] for one in abilities),
        teammate_abilities=tuple(
            tuple(place[f"{who}.ability.{one}"] for one in abilities) for who in teammates
        ),
        teammate_places=tuple(at(who) for who in teammates),
        victim_present=place["victim_0.present"],
        victim_needs=tuple(place[f"victim_0.need.{one}"] for one in abilities),
        victim_place=at("victim_0"),
        own_place=None if teammates_in_order else own_place,
    )


def hearing(names: Sequence[str], delay: int) -> Hearing:
    """How an observation says whom a robot hears.

    It hears those whose ``teammate_k.heard`` says so. Where nothing limits that, there is no such
    column: it hears all whom it sees to be available, or, where its sight is limited, all.

    Args:
        names: Of all columns, as the worlds name them.
        delay: Control steps from saying to hearing.
    """
    place = {name: column for column, name in enumerate(names)}
    teammates = _teammates(names)

    def columns(quantity: str) -> tuple[int, ...]:
        found = (f"{who}.{quantity}" for who in teammates)
        return tuple(place[name] for name in found if name in place)

    seen, heard = columns("seen"), columns("heard")
    places = zip(columns("relative_position.x"), columns("relative_position.y"), strict=True)
    return Hearing(
        sends=place["own.available"],
        heard=heard or (() if seen else columns("available")),
        places=tuple(places),
        seen=seen,
        delay=delay,
    )


def _teammates(names: Sequence[str]) -> list[str]:
    owners = (name.partition(".")[0] for name in names)
    return list(dict.fromkeys(owner for owner in owners if owner.startswith("teammate_")))
