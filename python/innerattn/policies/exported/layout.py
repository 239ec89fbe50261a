"""Where the numbers of an observation stand, read off the names of its columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from innerattn.policies.exported.contract import Contract

STORES = ("charge", "load")
"""What a robot uses up, as shares."""
SPOTS = ("station", "depot")
"""What fills these; an observation holds the way to the nearest one."""
TIMES = ("served", "time_left", "blocked")
"""Shares that are read of each victim where an observation has columns for them; whether it is
blocked is 0 or 1."""
_FAULT, _RAY = "own.fault.", "own.ray."
_PAIR = ("x", "y")


@dataclass(frozen=True)
class Layout:
    """The parts of an observation: which there are, and how many columns each has.

    Attributes:
        abilities: all abilities, in the order of columns.
        faults: kinds of faults in a robot's block.
        stores: those of `STORES` in a robot's block.
        headings: whether robots have headings: two columns of each robot and of each victim, and
            the robot's own turn rate.
        spots: those of `SPOTS` behind the robot's own block.
        rays: columns of rays behind it.
        sight: whether sight is limited: columns say what is seen, and when the rest was.
        hears: whether a column of each teammate says if it is heard.
        times: those of `TIMES` of each victim.
    """

    abilities: tuple[str, ...]
    faults: tuple[str, ...]
    stores: tuple[str, ...]
    headings: bool
    spots: tuple[str, ...]
    rays: int
    sight: bool
    hears: bool
    times: tuple[str, ...]

    @cached_property
    def available(self) -> int:
        """Column of availability in a robot's block; faults follow, and then `stores`."""
        return 4 + len(self.abilities)

    @cached_property
    def stores_from(self) -> int:
        """First column of `stores` in a robot's block."""
        return self.available + 1 + len(self.faults)

    @cached_property
    def heading(self) -> int:
        """First column of the heading in a robot's block."""
        return self.stores_from + len(self.stores)

    @cached_property
    def robot(self) -> int:
        """Columns of a robot's block."""
        return self.heading + 2 * self.headings

    @cached_property
    def own(self) -> int:
        """Columns of the robot's own block and of the ways, the turn rate and the rays behind."""
        return self.robot + 2 * len(self.spots) + self.headings + self.rays

    @cached_property
    def mate(self) -> int:
        """Columns of a teammate: a robot's, whether it is seen, since when not, if it is heard."""
        return self.robot + 2 * self.sight + self.hears

    @cached_property
    def place(self) -> int:
        """First column of the place in a victim's block."""
        return 1 + len(self.abilities)

    @cached_property
    def victim(self) -> int:
        """Columns of a victim."""
        return self.place + 2 + len(self.times) + self.sight + 2 * self.headings

    def names(self, teammates: int, victims: int) -> Iterator[str]:
        """The names of all columns, in their order."""
        for robot in range(1 + teammates):
            who, relative = (f"teammate_{robot - 1}", "relative_") if robot else ("own", "")
            for quantity in ("position", "velocity"):
                yield from (f"{who}.{relative}{quantity}.{axis}" for axis in _PAIR)
            yield from (f"{who}.ability.{one}" for one in self.abilities)
            yield f"{who}.available"
            yield from (f"{who}.fault.{one}" for one in self.faults)
            yield from (f"{who}.{one}" for one in self.stores)
            yield from (f"{who}.heading.{axis}" for axis in _PAIR if self.headings)
            if robot == 0:
                yield from (f"{who}.{spot}.{axis}" for spot in self.spots for axis in _PAIR)
                yield from ("own.turn_rate",) * self.headings
                yield from (f"{_RAY}{ray}" for ray in range(self.rays))
                continue
            yield from (f"{who}.seen", f"{who}.since_seen") if self.sight else ()
            yield from (f"{who}.heard",) * self.hears
        for victim in (f"victim_{slot}" for slot in range(victims)):
            yield f"{victim}.present"
            yield from (f"{victim}.need.{one}" for one in self.abilities)
            yield from (f"{victim}.relative_position.{axis}" for axis in _PAIR)
            yield from (f"{victim}.{one}" for one in self.times)
            yield from (f"{victim}.since_seen",) * self.sight
            yield from (f"{victim}.ahead", f"{victim}.left") if self.headings else ()


def layout_of(contract: Contract) -> Layout:
    """The parts of a team's observation.

    Raises:
        ValueError: its columns are not those that the worlds make of such a team.
    """
    names = [column.name for column in contract.observation]
    known = set(names)
    layout = Layout(
        abilities=contract.abilities,
        faults=tuple(name.removeprefix(_FAULT) for name in names if name.startswith(_FAULT)),
        stores=tuple(one for one in STORES if f"own.{one}" in known),
        headings="own.heading.x" in known,
        spots=tuple(one for one in SPOTS if f"own.{one}.x" in known),
        rays=sum(name.startswith(_RAY) for name in names),
        sight="victim_0.since_seen" in known,
        hears="teammate_0.heard" in known,
        times=tuple(one for one in TIMES if f"victim_0.{one}" in known),
    )
    expected = list(layout.names(observed_teammates(contract), observed_victims(contract)))
    if len(names) != len(expected) or bool(layout.faults) != contract.observe_faults:
        raise ValueError(f"observation: has {len(names)} columns: must have {len(expected)}")
    for column, (found, wanted) in enumerate(zip(names, expected)):
        if found != wanted:
            raise ValueError(f"observation: column {column} is {found!r}: must be {wanted!r}")
    _check_bodies(contract, layout)
    return layout


def observed_teammates(contract: Contract) -> int:
    """Teammates in an observation."""
    return _at_most(contract.scenario.get("observed_teammates"), len(contract.robots) - 1)


def observed_victims(contract: Contract) -> int:
    """Victims in an observation."""
    return _at_most(contract.scenario.get("observed_victims"), contract.victim_slots)


def _at_most(wanted: object, there: int) -> int:
    """What a scenario wants in an observation of what is there; None: all."""
    return min(wanted, there) if isinstance(wanted, int) else there


def _check_bodies(contract: Contract, layout: Layout) -> None:
    """Refuse robots that have what no column shows."""
    for robot in contract.robots:
        if robot.has_wheels and not layout.headings:
            raise ValueError(f"robots: {robot.name} has wheels, but no column holds a heading")
        if robot.range_sensor is not None and robot.range_sensor.rays > layout.rays:
            raise ValueError(f"robots: {robot.name} has more rays than there are columns")
    for spot, places in (("station", contract.stations), ("depot", contract.depots)):
        if bool(places) != (spot in layout.spots):
            raise ValueError(f"{spot}s: there must be some exactly where columns hold ways there")
