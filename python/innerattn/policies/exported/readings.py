"""From what a robot knows by name to its row of numbers, as the worlds build it.

What is missing is written as the worlds write it: the block of a teammate that is not heard, or
where sight is limited not seen, is zeros, as under the fault `lost_communication`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import ReadingError, StaleReadingError
from innerattn.policies.exported.contract import Contract, Member
from innerattn.policies.exported.layout import layout_of
from innerattn.policies.exported.observed import Observed
from innerattn.policies.exported.values import (
    given,
    listed,
    mapping,
    not_negative,
    number,
    pair,
    refuse_unknown,
    share,
    shown,
)

_KEYS = frozenset({"own", "teammates", "victims", "now", "victims_time"})
_BODY_KEYS = frozenset({"position", "velocity", "available", "faults", "time"})
_VICTIM_KEYS = frozenset({"task", "position"})
_UNSEEN = "since_seen"
_UNSEEN_KEYS = frozenset({_UNSEEN, "time"})
_MOST_SPEED_MPS = 1e4
_MOST_ANGLE_RAD = 1e4
_HEALTHY_AT_ONE = frozenset({"motor_gain", "speed_limit"})
"""Kinds of faults whose healthy value is 1; that of the others is 0."""


class RowBuilder:
    """Builds the rows of one robot.

    Attributes:
        teammates: names of the teammates, in the order of their blocks.
        max_age_s: how old a reading may be, or how far in the future [s].
    """

    def __init__(self, contract: Contract, robot: int, max_age_s: float) -> None:
        """Prepare the columns of the robot with this number.

        Raises:
            ValueError: the columns of the contract are not those of its team.
        """
        layout = layout_of(contract)
        self._layout = layout
        members = [contract.robots[robot]]
        members += [other for index, other in enumerate(contract.robots) if index != robot]
        self._own, self._mates = members[0], members[1:]
        self.teammates = tuple(one.name for one in self._mates)
        self.max_age_s = max_age_s
        self._keys = _KEYS | ({"heard"} if layout.hears else set())
        self._body_keys = {one.name: _body_keys(one) for one in members}
        self._own_keys = self._body_keys[self._own.name]
        if self._own.has_wheels:
            self._own_keys |= {"turn_rate"}
        if self._own.range_sensor is not None:
            self._own_keys |= {"ranges"}
        self._names = [column.name for column in contract.observation]
        self._victim_keys = (
            _VICTIM_KEYS | set(layout.times) | ({_UNSEEN} if layout.sight else set())
        )
        self._slots = contract.victim_slots
        self._by_relevance = contract.victim_order == "relevant"
        self._most_position_m = 2.0 * contract.arena_half_width_m
        self._needs = {
            task.name: np.array([1, *(task.amount(one) for one in layout.abilities)], np.float32)
            for task in contract.tasks
        }
        own = set(self._own.abilities)
        self._cannot_help = {task.name: own.isdisjoint(task.needs) for task in contract.tasks}
        places = {"station": contract.stations, "depot": contract.depots}
        self._spots = [np.array(places[spot], np.float32) for spot in layout.spots]
        self._victims_from = layout.own + len(self._mates) * layout.mate
        self._observed = Observed.of(contract, layout)
        self._fixed = self._fixed_row()

    def _fixed_row(self) -> NDArray[np.float32]:
        """What holds until a reading says other: abilities, healthy, available, full, unseen."""
        layout = self._layout
        width = self._victims_from + self._slots * layout.victim
        row = np.zeros(width, np.float32)
        own, mates = self._blocks(row)
        healthy = [1.0 if one in _HEALTHY_AT_ONE else 0.0 for one in layout.faults]
        for block, member in zip((own, *mates), (self._own, *self._mates)):
            offered = member.abilities
            if not isinstance(offered, Mapping):
                offered = dict.fromkeys(offered, 1.0)
            block[4 : layout.available] = [offered.get(one, 0.0) for one in layout.abilities]
            block[layout.available] = 1.0
            block[layout.available + 1 : layout.stores_from] = healthy
            block[layout.stores_from : layout.heading] = 1.0
        if layout.sight:
            self._victim_blocks(row)[:, self._since_seen] = 1.0
        return row

    def _blocks(self, row: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The robot's own block, and those of its teammates (R - 1, columns)."""
        layout = self._layout
        mates = row[layout.own : self._victims_from].reshape(len(self._mates), layout.mate)
        return row[: layout.robot], mates

    def _victim_blocks(self, row: NDArray[np.float32]) -> NDArray[np.float32]:
        return row[self._victims_from :].reshape(self._slots, self._layout.victim)

    @property
    def _since_seen(self) -> int:
        """Column of the time since it was last seen in a victim's block."""
        return self._layout.victim - 1 - 2 * self._layout.headings

    def row(self, readings: Mapping[str, Any]) -> NDArray[np.float32]:
        """The row (D,) float32 of readings.

        Args:
            readings: see `Exported.decide`.

        Raises:
            ReadingError: a reading is wrong or missing.
            StaleReadingError: one of the robot itself or of the victims is too old.
        """
        refuse_unknown(readings, self._keys, "")
        now = readings.get("now")
        if now is not None:
            now = number(now, "now", np.inf)
        row = self._fixed.copy()
        block, blocks = self._blocks(row)
        own = mapping(given(readings, "own"), "own")
        refuse_unknown(own, self._own_keys, "own.")
        motion = np.array(self._body(own, self._own, "own", block), np.float32)
        block[:4] = motion
        self._refuse_stale(own, "time", now, "own.time")
        if self._layout.own > self._layout.robot:
            self._write_senses(own, row)
        self._write_teammates(readings, motion, blocks, now)
        victims = given(readings, "victims")
        self._refuse_stale(readings, "victims_time", now, "victims_time")
        self._write_victims(victims, motion[:2], row)
        return self._observed.row(row)

    def dark_row(self, own: Mapping[str, Any]) -> NDArray[np.float32]:
        """The row (D,) float32 of a robot whose sensors give nothing, as under `blackout`.

        Its own abilities, availability, faults, charge and load are left, and all else is zeros.

        Args:
            own: ``available`` and ``faults``, both optional; ``charge`` and ``load`` of a robot
                that has them.

        Raises:
            ReadingError: a reading is wrong.
        """
        known = frozenset({"available", "faults", *self._own.stores})
        refuse_unknown(own, known, "own.")
        row = np.zeros(len(self._names), np.float32)
        row[4 : self._layout.heading] = self._fixed[4 : self._layout.heading]
        self._flags(own, self._own, "own", row[: self._layout.robot])
        return row

    def checked_row(self, row: Any) -> NDArray[np.float32]:
        """A row (D,) that was built elsewhere, as float32.

        Raises:
            ReadingError: another shape or dtype, or a value that is not finite.
        """
        found = np.asarray(row)
        width = len(self._names)
        if found.dtype.kind not in "fiu" or found.shape != (width,):
            raise ReadingError(
                "row",
                f"has dtype {found.dtype} and shape {found.shape}: must hold {width} numbers",
            )
        finite = np.abs(found) <= np.finfo(np.float32).max
        if not finite.all():
            column = int(np.argmin(finite))
            raise ReadingError(f"row.{self._names[column]}", f"is {found[column]}: must be finite")
        return found.astype(np.float32, copy=False)

    def _write_teammates(
        self,
        readings: Mapping[str, Any],
        motion: NDArray[np.float32],
        blocks: NDArray[np.float32],
        now: float | None,
    ) -> None:
        """Write the blocks of teammates beside a robot of this place and velocity (4,)."""
        layout = self._layout
        teammates = mapping(given(readings, "teammates"), "teammates")
        self._refuse_strangers(teammates, "teammates.")
        motions, silent, since = [], [], []
        for index, member in enumerate(self._mates):
            place = f"teammates.{member.name}"
            known, unseen = self._known(teammates.get(member.name), place, now)
            since.append(unseen)
            if known is None:
                silent.append(index)
                motions.append((0.0, 0.0, 0.0, 0.0))
            else:
                refuse_unknown(known, self._body_keys[member.name], f"{place}.")
                motions.append(self._body(known, member, place, blocks[index]))
        if motions:
            blocks[:, :4] = np.array(motions, np.float32) - motion
        if silent:
            blocks[silent] = 0.0
        if layout.sight:
            blocks[:, layout.robot] = 1.0
            blocks[silent, layout.robot] = 0.0
            blocks[:, layout.robot + 1] = since
        if layout.hears:
            heard = listed(given(readings, "heard"), "heard")
            named = {str(one): True for one in heard}
            self._refuse_strangers(named, "heard.")
            blocks[:, layout.mate - 1] = [name in named for name in self.teammates]

    def _refuse_strangers(self, names: Mapping[str, Any], place: str) -> None:
        if unknown := [name for name in names if name not in self.teammates]:
            known = ", ".join(self.teammates)
            raise ReadingError(f"{place}{unknown[0]}", f"is no teammate; those are {known}")

    def _known(
        self, message: Any, place: str, now: float | None
    ) -> tuple[Mapping[str, Any] | None, float]:
        """What is known of a teammate now, None if nothing is, and the share of the time since."""
        if message is None:
            return None, 1.0
        body = mapping(message, place)
        if self._layout.sight and _UNSEEN in body:
            refuse_unknown(body, _UNSEEN_KEYS, f"{place}.")
            return None, _share_of(not_negative(body[_UNSEEN], f"{place}.{_UNSEEN}"))
        if now is None:
            return body, 0.0
        time = number(given(body, "time", f"{place}."), f"{place}.time", np.inf)
        age = abs(now - time)
        return (body, 0.0) if age <= self.max_age_s else (None, _share_of(age))

    def _body(
        self, body: Mapping[str, Any], member: Member, place: str, block: NDArray[np.float32]
    ) -> tuple[float, float, float, float]:
        """Place and velocity of a robot; everything else that it tells goes into its block."""
        x, y = pair(body, "position", place, self._most_position_m)
        vx, vy = pair(body, "velocity", place, _MOST_SPEED_MPS)
        self._flags(body, member, place, block)
        if member.has_wheels:
            value = given(body, "heading", f"{place}.")
            angle = number(value, f"{place}.heading", _MOST_ANGLE_RAD)
            at = self._layout.heading
            block[at], block[at + 1] = math.cos(angle), math.sin(angle)
        return x, y, vx, vy

    def _flags(
        self, body: Mapping[str, Any], member: Member, place: str, block: NDArray[np.float32]
    ) -> None:
        """Availability, faults, and what the robot has left of its charge and load."""
        layout = self._layout
        available = body.get("available", True)
        if available is not True:
            if not isinstance(available, (bool, np.bool_)):
                raise ReadingError(
                    f"{place}.available", f"is {shown(available)}: must be True or False"
                )
            block[layout.available] = available
        for key in member.stores:
            block[layout.stores_from + layout.stores.index(key)] = share(body, key, f"{place}.")
        faults = body.get("faults")
        if faults is None:
            return
        for kind, value in mapping(faults, f"{place}.faults").items():
            if kind not in layout.faults:
                known = ", ".join(layout.faults) or "none, as scenario.observe_faults is not set"
                raise ReadingError(f"{place}.faults.{kind}", f"is unknown; known are {known}")
            column = layout.available + 1 + layout.faults.index(kind)
            block[column] = number(value, f"{place}.faults.{kind}", 10.0)

    def _write_senses(self, own: Mapping[str, Any], row: NDArray[np.float32]) -> None:
        """Ways to the nearest station and depot, the turn rate, and what the rays measure."""
        column = self._layout.robot
        for places in self._spots:
            ways = places - row[:2]
            row[column : column + 2] = ways[np.argmin((ways * ways).sum(axis=1))]
            column += 2
        if self._own.has_wheels:
            row[column] = number(given(own, "turn_rate", "own."), "own.turn_rate", _MOST_SPEED_MPS)
        column += self._layout.headings
        sensor = self._own.range_sensor
        if sensor is None:
            return
        ranges = listed(given(own, "ranges", "own."), "own.ranges")
        if len(ranges) != sensor.rays:
            raise ReadingError(
                "own.ranges", f"has {len(ranges)} entries: must have {sensor.rays}, one a ray"
            )
        nothing = (None, math.inf)
        measured = [
            sensor.range_m if one in nothing else not_negative(one, f"own.ranges.{ray}")
            for ray, one in enumerate(ranges)
        ]
        most = np.float32(sensor.range_m)
        near = np.minimum(np.array(measured, np.float32), most)
        row[column : column + sensor.rays] = np.float32(1.0) - near / most

    def _refuse_stale(
        self, readings: Mapping[str, Any], key: str, now: float | None, place: str
    ) -> None:
        if now is None:
            return
        if key not in readings:
            raise ReadingError(place, "is missing; it must be there where `now` is")
        age = now - number(readings[key], place, np.inf)
        if abs(age) > self.max_age_s:
            when = f"{abs(age):.3f} s {'before' if age > 0 else 'after'} now"
            raise StaleReadingError(place, f"is {when}: must be at most {self.max_age_s:g} s away")

    def _write_victims(
        self, victims: Any, own: NDArray[np.float32], row: NDArray[np.float32]
    ) -> None:
        victims = listed(victims, "victims")
        if len(victims) > self._slots:
            raise ReadingError(
                "victims", f"has {len(victims)} entries: must have at most {self._slots}"
            )
        layout = self._layout
        slots, tasks, places, shares = [], [], [], []
        unseen = [1.0] * self._slots
        for slot, victim in enumerate(victims):
            if victim is None:
                continue
            place = f"victims.{slot}"
            body = mapping(victim, place)
            if layout.sight and _UNSEEN in body:
                since = not_negative(body[_UNSEEN], f"{place}.{_UNSEEN}")
                unseen[slot] = _share_of(since)
                if len(body) == 1:
                    continue
            elif layout.sight:
                unseen[slot] = 0.0
            refuse_unknown(body, self._victim_keys, f"{place}.")
            task = given(body, "task", f"{place}.")
            if not isinstance(task, str) or task not in self._needs:
                known = ", ".join(self._needs)
                raise ReadingError(f"{place}.task", f"is {shown(task)}: known are {known}")
            places.append(pair(body, "position", place, self._most_position_m))
            shares.append([share(body, one, f"{place}.") for one in layout.times])
            slots.append(slot)
            tasks.append(task)
        blocks = self._victim_blocks(row)
        order = list(range(len(tasks)))
        targets = slots
        relative = np.array(places, np.float32).reshape(-1, 2) - own
        if self._by_relevance and slots:
            squares = relative * relative
            far = (squares[:, 0] + squares[:, 1]).tolist()
            order.sort(key=lambda i: (self._cannot_help[tasks[i]], far[i]))
            targets = list(range(len(tasks)))
        ways = relative.tolist()
        for target, index in zip(targets, order):
            blocks[target, : layout.place] = self._needs[tasks[index]]
            place_and_shares = [*ways[index], *shares[index]]
            blocks[target, layout.place : layout.place + len(place_and_shares)] = place_and_shares
        if layout.sight:
            self._write_unseen(unseen, slots, [slots[index] for index in order], blocks)
        if layout.headings:
            ahead = row[layout.heading : layout.heading + 2]
            x, y = blocks[:, layout.place], blocks[:, layout.place + 1]
            blocks[:, -2] = ahead[0] * x + ahead[1] * y
            blocks[:, -1] = ahead[0] * y - ahead[1] * x

    def _write_unseen(
        self,
        unseen: list[float],
        known: list[int],
        ordered: list[int],
        blocks: NDArray[np.float32],
    ) -> None:
        """For how long victims were not seen.

        In the order of relevance the slots of which nothing is known follow the others by that
        time, so that nothing tells of what the robot does not know.
        """
        if not self._by_relevance:
            blocks[:, self._since_seen] = unseen
            return
        hidden = sorted(one for slot, one in enumerate(unseen) if slot not in known)
        blocks[:, self._since_seen] = [*(unseen[slot] for slot in ordered), *hidden]


def _body_keys(member: Member) -> frozenset[str]:
    """What a robot tells of itself."""
    return _BODY_KEYS | set(member.stores) | ({"heading"} if member.has_wheels else set())


def _share_of(seconds: float) -> float:
    """The time since something was seen as a share, t / (t + 1 s)."""
    time = np.float32(seconds)
    return float(time / (time + np.float32(1.0)))
