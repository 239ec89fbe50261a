"""What a robot for any team makes of a table: one row for each pair of a robot and a victim.

It is `innerattn.nn.teams.relations` for one robot's view, in numpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.contract import Contract
from innerattn.policies.exported.moves import GAINS_WIDTH, Moves
from innerattn.policies.exported.roles import Roles, roles_of
from innerattn.policies.exported.table import (
    ENDLESS_S,
    Bodies,
    Table,
    bodies_of,
    demand_of,
    refuse_too_many_needs,
)

Array = NDArray[np.float32]
Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]
Vector = tuple[float, float]

NEAREST = 6
"""Victims that a robot looks at, by its own arrival time; blocked ones come after all others."""
_BLOCKED_S = np.float32(100.0)
PAIR_WIDTH, TURNING_WIDTH, HOME_WIDTH = 27, 10 + GAINS_WIDTH, 16 + GAINS_WIDTH
NEVER_S = 1e3
"""Arrival time of nobody [s]."""
_LONGEST_S = 8.0
"""Beyond this, arrival times tell no more."""
_FARTHEST_M = 2.0
_KEPT_ROLES = 16
# Arrays of no dimension cost numpy less than numbers do.
_ZERO, _ONE, _SHORTEST, _LONGEST, _NEVER = (
    np.array(value, np.float32) for value in (0.0, 1.0, 1e-6, _LONGEST_S, NEVER_S)
)


class Column:
    """Columns of a pair."""

    (
        DISTANCE,
        TIME,
        TOWARDS,
        INSIDE,
        NEEDED,
        MET,
        FILLS,
        SPARE,
        SPARE_MINE,
        SPEED,
        PUSH,
        ARENA,
        WAITING,
        MOST_WAITING,
        RANK,
        LATER,
        CHOICES,
        WITHOUT,
        OTHERS,
        LAST,
        NEARER,
        RIVALS,
        PARTNERS,
        WAIT,
        LEFT,
        BLOCKED,
        TO_SPARE,
    ) = range(PAIR_WIDTH)


_RANGES = {
    Column.SPARE: (-1.0, 4.0),
    Column.SPARE_MINE: (-1.0, 4.0),
    Column.PUSH: (-np.inf, 3.0),
    Column.LATER: (0.0, 4.0),
    Column.WITHOUT: (-3.0, 3.0),
    Column.OTHERS: (-np.inf, 4.0),
    Column.LAST: (-3.0, 3.0),
    Column.NEARER: (-np.inf, 4.0),
    Column.RIVALS: (-np.inf, 6.0),
    Column.PARTNERS: (-np.inf, 6.0),
    Column.WAIT: (-np.inf, 4.0),
    Column.LEFT: (-np.inf, 8.0),
    Column.TO_SPARE: (-3.0, 3.0),
}
"""What columns are cut to."""
_UNITS = {
    Column.TIME: 2,
    Column.NEEDED: 3,
    Column.MET: 3,
    Column.FILLS: 2,
    Column.SPARE: 3,
    Column.SPARE_MINE: 3,
    Column.WAITING: 4,
    Column.MOST_WAITING: 4,
    Column.RANK: 2,
    Column.CHOICES: 3,
    Column.NEARER: 3,
    Column.RIVALS: 3,
    Column.PARTNERS: 3,
    Column.WAIT: 2,
    Column.LEFT: 4,
}
"""What they are divided by then."""
LOW, HIGH = (
    np.array([_RANGES.get(one, (-np.inf, np.inf))[end] for one in range(PAIR_WIDTH)], np.float32)
    for end in (0, 1)
)
SCALE = np.array([1 / _UNITS.get(one, 1) for one in range(PAIR_WIDTH)], np.float32)
"""What columns are cut to, and multiplied by then."""


class Pairs(NamedTuple):
    """The pairs of R robots and M victims, and the m pairs of the robot itself, which is the first.

    Attributes:
        columns: (M, R, PAIR_WIDTH) float32.
        there: (M, R, 1) float32, 1 where there is a pair, else 0.
        at: (m,) victims of the robot's pairs.
        frames: the frame of each, which brings its victim to x >= y >= 0.
        turning: (m, TURNING_WIDTH) vectors (x, y) in each pair's frame, and what actions gain.
        masks: (m, 2, R, R) bool, whose part each robot could take there, and who completes it.
        times: (M, R) arrival times of all robots [s].
    """

    columns: Array
    there: Array
    at: Numbers
    frames: list[int]
    turning: Array
    masks: Mask
    times: Array


class Home(NamedTuple):
    """The robot itself: (HOME_WIDTH) numbers, and the frame of its way to the centre."""

    columns: list[float]
    frame: int


class _Known(NamedTuple):
    """What holds as long as needs and abilities do not change.

    Attributes:
        roles: of all robots at all victims.
        choices: victims that the robot can help.
        never: (M, R) float32, `NEVER_S` where a robot cannot help, else 0.
        there: (M, R, 1) float32, 1 where a robot can help, else 0.
        starts: (M, 1) where each victim's row begins in an array of (M, R).
        places: (1 + R,) numbers from 0.
        masks: (M, 2, R, R) bool, rivals and partners of each robot.
        columns: (M, R, PAIR_WIDTH) float32; zeros where places and velocities decide.
    """

    roles: Roles
    choices: int
    never: Array
    there: Array
    starts: Numbers
    places: Numbers
    masks: Mask
    columns: Array


class Relating:
    """Makes the pairs of one robot of a team."""

    def __init__(self, contract: Contract, order: list[int]) -> None:
        """Take what is known of the team beforehand.

        Args:
            contract: of the team.
            order: numbers of the robots in it, the robot itself first.
        """
        assert contract.network.pairs is not None  # as such a policy has them
        self._radius = np.float32(contract.network.pairs.rescue_radius_m)
        self._half, self._victims = contract.arena_half_width_m, contract.victim_slots
        self._bodies: Bodies = bodies_of(contract, order)
        self._speed = np.maximum(self._bodies.speed, np.float32(1e-6))
        own = (self._bodies.speed[0], self._bodies.lag[0], min(self._bodies.push[0], 3.0))
        self._body = [float(one) for one in own]
        self._moves = Moves(self._bodies)
        self._demand = demand_of(contract)
        self._known = lru_cache(_KEPT_ROLES)(self._known_of)
        self._asked = lru_cache(_KEPT_ROLES)(self._asked_of)
        self._abilities = len(contract.abilities)

    def relate(self, table: Table) -> tuple[Pairs | None, Home]:
        """The pairs of a table, None if the robot can help no victim; and the robot itself.

        Raises:
            ReadingError: a victim needs more than `MOST_NEEDS` abilities.
        """
        mate = nearest_teammate(table)
        pairs, soonest, choices = self._pairs(table, mate)
        return pairs, self._home(table, mate, soonest, choices)

    def _pairs(self, table: Table, mate: Vector) -> tuple[Pairs | None, float, int]:
        """The pairs, when it could be at one first [s], and how many it can help.

        Args:
            table: of the robot.
            mate: way to its nearest teammate, as of `nearest_teammate`.
        """
        if not table.needs.size:
            return None, NEVER_S, 0
        known = self._known(table.needs.tobytes(), table.abilities.tobytes())
        if not known.choices:
            return None, NEVER_S, 0
        roles = known.roles
        ways = table.victims[:, :, None] - table.places[:, None]  # (2, M, R)
        squares = ways * ways
        distance = np.sqrt(squares[0] + squares[1])
        moving = ways * table.velocities[:, None]
        towards = (moving[0] + moving[1]) / np.maximum(distance, _SHORTEST)
        gap = np.maximum(distance - self._radius, _ZERO)
        late = np.maximum(self._bodies.lag * (_ONE - towards / self._speed), _ZERO)
        times = np.minimum(gap / self._speed + late * (gap > _ZERO), _LONGEST)
        own = times + known.never
        if table.waits is not None:
            own += _BLOCKED_S * table.waits[:, 2:]
        order = own.argsort(axis=0, kind="stable")
        ranks = order.argsort(axis=0)
        soonest = own.min(axis=0)
        inside = (distance <= self._radius) & roles.useful
        nearer = (times[:, None] < times[:, :, None]) & roles.rivals
        met = (roles.useful_in * inside).sum(axis=2) + roles.elsewhere
        without, others = _when_filled(times, known)

        columns = known.columns.copy()
        columns[..., Column.DISTANCE] = distance
        columns[..., Column.TIME] = times
        columns[..., Column.TOWARDS] = towards
        columns[..., Column.INSIDE] = inside
        columns[..., Column.MET] = met.min(axis=0)[:, None]
        columns[..., Column.RANK] = ranks
        columns[..., Column.LATER] = times - soonest
        columns[..., Column.WITHOUT] = without - times
        columns[..., Column.OTHERS] = others
        columns[..., Column.LAST] = others - times
        columns[..., Column.NEARER] = nearer.sum(axis=2)
        if table.waits is not None:
            _add_waits(columns, table.waits, np.maximum(times, others) + known.never)
        np.maximum(columns, LOW, out=columns)
        np.minimum(columns, HIGH, out=columns)
        columns *= SCALE

        there = known.there
        if len(times) > NEAREST:
            there = there * (ranks < NEAREST)[..., None]
        at = there[:, 0, 0].nonzero()[0]
        frames, turning = self._turning(table, ways[:, :, 0].T, own[:, 0], order[:, 0], at, mate)
        masks = known.masks.take(at, axis=0)
        pairs = Pairs(columns, there, at, frames, turning, masks, times)
        return pairs, float(soonest[0]), known.choices

    def _home(self, table: Table, mate: Vector, soonest: float, choices: int) -> Home:
        """The robot itself, after what `_pairs` says of it."""
        x, y = table.places[:, 0].tolist()
        way, velocity = (-x, -y), tuple(table.velocities[:, 0].tolist())
        frame = frame_of(way)
        most, *asked = self._asked(table.abilities.tobytes())
        columns = [
            *self._body,
            float(choices > 0),
            choices / 3,
            most,
            min(soonest, 4.0),
            self._half,
            *asked,
            *self._turned((way, velocity, mate), frame),
        ]
        return Home(columns, frame)

    def _turning(
        self,
        table: Table,
        ways: Array,
        own: Array,
        order: Numbers,
        at: Numbers,
        mate: Vector,
    ) -> tuple[list[int], Array]:
        """Frames of the robot's own pairs, and vectors in them.

        Args:
            table: of the robot.
            ways: (M, 2) from the robot to each victim.
            own: (M,) its arrival times; `NEVER_S` where it cannot help.
            order: (M,) victims by these.
            at: (m,) victims of its pairs.
            mate: way to its nearest teammate.
        """
        place, velocity = table.places[:, 0].tolist(), table.velocities[:, 0].tolist()
        first, second = (*order[:2].tolist(), -1)[:2]
        found = ways.tolist()
        nothing = (0.0, 0.0)
        frames, rows = [], []
        for victim in at.tolist():
            other = second if victim == first else first
            helps = other >= 0 and own[other] < NEVER_S
            frame = frame_of(found[victim])
            frames.append(frame)
            vectors = (found[victim], velocity, mate, place, found[other] if helps else nothing)
            rows.append(self._turned(vectors, frame))
        return frames, np.array(rows, np.float32)

    def _turned(self, vectors: Sequence[Vector], frame: int) -> list[float]:
        """Vectors in a frame, the first a way and the second the velocity, and gains on the way."""
        in_frame = [turned(vector, frame) for vector in vectors]
        gains = self._moves.gains(in_frame[0], in_frame[1])
        return [*[part for vector in in_frame for part in vector], *gains]

    def _known_of(self, needs: bytes, abilities: bytes) -> _Known:
        """The bytes are those of (M, K) and (R, K) float32."""
        wanted, able = (
            np.frombuffer(data, np.float32).reshape(-1, self._abilities)
            for data in (needs, abilities)
        )
        refuse_too_many_needs(wanted)
        roles = roles_of(wanted, able)
        columns = np.zeros((*roles.useful.shape, PAIR_WIDTH), np.float32)
        columns[..., Column.NEEDED] = roles.needed[:, None]
        columns[..., Column.FILLS] = roles.filled_by
        columns[..., Column.SPARE] = roles.spare[:, None]
        columns[..., Column.SPARE_MINE] = roles.spare_mine
        columns[..., Column.SPEED] = self._speed
        columns[..., Column.PUSH] = self._bodies.push
        columns[..., Column.ARENA] = self._half
        columns[..., Column.WAITING] = len(wanted)
        columns[..., Column.MOST_WAITING] = self._victims
        columns[..., Column.CHOICES] = roles.useful.sum(axis=0)
        columns[..., Column.RIVALS] = roles.rivals.sum(axis=2)
        columns[..., Column.PARTNERS] = roles.partners.sum(axis=2)
        columns[..., Column.LEFT] = ENDLESS_S
        columns[..., Column.TO_SPARE] = ENDLESS_S
        count, size = roles.useful.shape
        return _Known(
            roles=roles,
            choices=int(roles.useful[:, 0].sum()),
            never=np.where(roles.useful, np.float32(0.0), np.float32(NEVER_S)),
            there=roles.useful[..., None].astype(np.float32),
            starts=np.arange(0, count * size, size)[:, None],
            places=np.arange(1 + size),
            masks=np.stack([roles.rivals, roles.partners], axis=1),
            columns=columns,
        )

    def _asked_of(self, abilities: bytes) -> tuple[float, float, float]:
        """The most that the robot offers, and how much its abilities are asked for.

        The second is of the scarcest one, the third of all.
        """
        have = np.frombuffer(abilities, np.float32).reshape(-1, self._abilities)
        share = have[0] * (self._demand / np.maximum(have.sum(axis=0), np.float32(1.0)))
        return float(have[0].max()), float(share.max()), float(share.sum())


def _add_waits(columns: Array, waits: Array, ready: Array) -> None:
    """Columns of service, deadline and order.

    Args:
        columns: (M, R, PAIR_WIDTH), to be filled.
        waits: (M, 3), as of `Table`.
        ready: (M, R) when a robot and enough others could be there; `NEVER_S` or more where it
            cannot help [s].
    """
    wait, left, blocked = waits[:, :1], waits[:, 1:2], waits[:, 2:]
    complete = np.minimum(ready.min(axis=1, keepdims=True), _NEVER)
    columns[..., Column.WAIT] = wait
    columns[..., Column.LEFT] = left
    columns[..., Column.BLOCKED] = blocked
    columns[..., Column.TO_SPARE] = np.where(left < ENDLESS_S, left - complete - wait, ENDLESS_S)


def _when_filled(times: Array, known: _Known) -> Array:
    """When others fill needs of M victims, for R robots at times (M, R): (2, M, R).

    From when on they fill all that this robot could fill, and when enough others could be there to
    complete it [s].
    """
    victims, size = times.shape
    roles, useful = known.roles, known.roles.useful_in
    order = times.argsort(axis=1, kind="stable")
    place = order.argsort(axis=1)
    order += known.starts
    room = np.zeros((*useful.shape[:2], 1 + size), np.float32)  # after so many arrivals
    useful.reshape(len(useful), -1).take(order, axis=1).cumsum(axis=2, out=room[..., 1:])
    room += roles.elsewhere[..., None]
    moments = np.zeros((victims, 1, 1 + size), np.float32)
    moments[:, 0, 1:] = times.take(order)
    helps = useful[..., None]
    others = room[:, :, None] - helps * (place[..., None] < known.places)  # (S, M, R, 1 + R)
    without = others.min(axis=0)
    others += helps
    beside = others.min(axis=0)
    holds = np.empty((2, *without.shape), np.bool_)
    np.equal(beside, without, out=holds[0])
    np.greater_equal(beside, roles.needed[:, None, None], out=holds[1])
    found: Array = np.where(holds, moments, _NEVER).min(axis=3)
    return found


def nearest_teammate(table: Table) -> Vector:
    """The way to the nearest teammate that is heard, at most 2 m in x and y; zero if there is none.

    Args:
        table: of the robot.
    """
    (x, *xs), (y, *ys) = table.places.tolist()
    least, mate = np.inf, (0.0, 0.0)
    for there, mate_x, mate_y in zip(table.there[1:], xs, ys):
        across, along = mate_x - x, mate_y - y
        square = across * across + along * along
        if there and square < least:
            least, mate = square, (across, along)
    across, along = mate
    most = _FARTHEST_M
    return min(max(across, -most), most), min(max(along, -most), most)


def frame_of(vector: Vector | list[float]) -> int:
    """The element that brings a vector to x >= y >= 0; see `innerattn.policies.exported.frame`."""
    x, y = vector
    return (x < 0.0) + 2 * (y < 0.0) + 4 * (abs(y) > abs(x))


def turned(vector: Vector | list[float], frame: int) -> Vector:
    """A vector in a frame."""
    x, y = vector
    if frame & 1:
        x = -x
    if frame & 2:
        y = -y
    return (y, x) if frame & 4 else (x, y)
