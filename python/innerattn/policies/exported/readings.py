"""From what a robot knows by name to its row of numbers, as the worlds build it.

What is missing is written as the worlds write it: the block of a teammate that is not heard is
zeros, as under the fault `lost_communication`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import ReadingError, StaleReadingError
from innerattn.policies.exported.contract import Contract

_KEYS = frozenset({"own", "teammates", "victims", "now", "victims_time"})
_BODY_KEYS = frozenset({"position", "velocity", "available", "faults", "time"})
_VICTIM_KEYS = frozenset({"task", "position"})
TIMES = ("served", "time_left", "blocked")
"""Shares that are read of each victim where an observation has columns for them; whether it is
blocked is 0 or 1."""
_MOST_SPEED_MPS = 1e4
_FAULT = "own.fault."
_NUMBERS = (float, int, np.floating, np.integer)


class RowBuilder:
    """Builds the rows of one robot.

    Attributes:
        teammates: names of the teammates, in the order of their blocks.
        max_age_s: how old a reading may be, or how far in the future [s].
    """

    def __init__(self, contract: Contract, robot: int, max_age_s: float) -> None:
        """Prepare the columns of the robot with this number; the columns are known to fit."""
        team = contract.robots
        self._order = [robot, *(other for other in range(len(team)) if other != robot)]
        self.teammates = tuple(team[other].name for other in self._order[1:])
        self.max_age_s = max_age_s
        abilities = contract.abilities
        self._names = [column.name for column in contract.observation]
        self._faults = [
            name.removeprefix(_FAULT) for name in self._names if name.startswith(_FAULT)
        ]
        self._healthy = [1.0 if one in _SHARES else 0.0 for one in self._faults]
        self._available = 4 + len(abilities)
        self._width = self._available + 1 + len(self._faults)
        self._times = [one for one in TIMES if f"victim_0.{one}" in self._names]
        self._victim_keys = _VICTIM_KEYS | set(self._times)
        self._places_at = 1 + len(abilities)
        self._victim_width = self._places_at + 2 + len(self._times)
        self._slots = contract.victim_slots
        self._by_relevance = contract.victim_order == "relevant"
        self._most_position_m = 2.0 * contract.arena_half_width_m
        own = set(team[robot].abilities)
        self._needs = {
            task.name: np.array([1, *(_needed(task.needs, one) for one in abilities)], np.float32)
            for task in contract.tasks
        }
        self._cannot_help = {task.name: own.isdisjoint(task.needs) for task in contract.tasks}
        blocks = np.zeros((len(team), self._width), np.float32)
        for block, other in zip(blocks, self._order, strict=True):
            offered = team[other].abilities
            if not isinstance(offered, Mapping):
                offered = dict.fromkeys(offered, 1.0)
            block[4 : self._available] = [offered.get(one, 0.0) for one in abilities]
            block[self._available] = 1.0
            block[self._available + 1 :] = self._healthy
        self._fixed = np.zeros(len(self._names), np.float32)
        self._fixed[: blocks.size] = blocks.reshape(-1)
        self._victims_from = blocks.size

    def row(self, readings: Mapping[str, Any]) -> NDArray[np.float32]:
        """The row (D,) float32 of readings.

        Args:
            readings: see `Exported.decide`.

        Raises:
            ReadingError: a reading is wrong or missing.
            StaleReadingError: one of the robot itself or of the victims is too old.
        """
        _refuse_unknown(readings, _KEYS, "")
        now = readings.get("now")
        if now is not None:
            now = _number(now, "now", np.inf)
        row = self._fixed.copy()
        blocks = row[: self._victims_from].reshape(-1, self._width)
        own = _mapping(_given(readings, "own"), "own")
        motions = [self._body(own, "own", blocks[0])]
        self._refuse_stale(own, "time", now, "own.time")
        teammates = _mapping(_given(readings, "teammates"), "teammates")
        if unknown := [name for name in teammates if name not in self.teammates]:
            known = ", ".join(self.teammates)
            raise ReadingError(f"teammates.{unknown[0]}", f"is no teammate; those are {known}")
        silent = []
        for index, name in enumerate(self.teammates, 1):
            heard = self._heard(teammates.get(name), f"teammates.{name}", now)
            if heard is None:
                silent.append(index)
                motions.append((0.0, 0.0, 0.0, 0.0))
            else:
                motions.append(self._body(heard, f"teammates.{name}", blocks[index]))
        motion = np.array(motions, np.float32)
        motion[1:] -= motion[0]
        blocks[:, :4] = motion
        if silent:
            blocks[silent] = 0.0
        victims = _given(readings, "victims")
        self._refuse_stale(readings, "victims_time", now, "victims_time")
        self._write_victims(victims, motion[0, :2], row)
        return row

    def dark_row(self, own: Mapping[str, Any]) -> NDArray[np.float32]:
        """The row (D,) float32 of a robot whose sensors give nothing, as under `blackout`.

        Its own abilities, availability and faults are left, and its teammates' blocks are zeros.

        Args:
            own: ``available`` and ``faults``, both optional.

        Raises:
            ReadingError: a reading is wrong.
        """
        _refuse_unknown(own, frozenset({"available", "faults"}), "own.")
        row = np.zeros_like(self._fixed)
        row[4 : self._width] = self._fixed[4 : self._width]
        self._flags(own, "own", row[: self._width])
        return row

    def checked_row(self, row: Any) -> NDArray[np.float32]:
        """A row (D,) that was built elsewhere, as float32.

        Raises:
            ReadingError: another shape or dtype, or a value that is not finite.
        """
        found = np.asarray(row)
        if found.dtype.kind not in "fiu" or found.shape != self._fixed.shape:
            raise ReadingError(
                "row",
                f"has dtype {found.dtype} and shape {found.shape}: must hold "
                f"{len(self._fixed)} numbers",
            )
        finite = np.abs(found) <= np.finfo(np.float32).max
        if not finite.all():
            column = int(np.argmin(finite))
            raise ReadingError(f"row.{self._names[column]}", f"is {found[column]}: must be finite")
        return found.astype(np.float32, copy=False)

    def _heard(self, message: Any, place: str, now: float | None) -> Mapping[str, Any] | None:
        """The last message of a teammate; None where there is none, or it is too old."""
        if message is None:
            return None
        body = _mapping(message, place)
        if now is None:
            return body
        time = _number(_given(body, "time", f"{place}."), f"{place}.time", np.inf)
        return body if abs(now - time) <= self.max_age_s else None

    def _body(
        self, body: Mapping[str, Any], place: str, block: NDArray[np.float32]
    ) -> tuple[float, float, float, float]:
        """Place and velocity of a robot; its availability and faults go into its block."""
        _refuse_unknown(body, _BODY_KEYS, f"{place}.")
        x, y = _pair(body, "position", place, self._most_position_m)
        vx, vy = _pair(body, "velocity", place, _MOST_SPEED_MPS)
        self._flags(body, place, block)
        return x, y, vx, vy

    def _flags(self, body: Mapping[str, Any], place: str, block: NDArray[np.float32]) -> None:
        available = body.get("available", True)
        if available is not True:
            if not isinstance(available, bool | np.bool_):
                raise ReadingError(
                    f"{place}.available", f"is {_shown(available)}: must be True or False"
                )
            block[self._available] = available
        faults = body.get("faults")
        if faults is None:
            return
        for kind, value in _mapping(faults, f"{place}.faults").items():
            if kind not in self._faults:
                known = ", ".join(self._faults) or "none, as scenario.observe_faults is not set"
                raise ReadingError(f"{place}.faults.{kind}", f"is unknown; known are {known}")
            column = self._available + 1 + self._faults.index(kind)
            block[column] = _number(value, f"{place}.faults.{kind}", 10.0)

    def _refuse_stale(
        self, readings: Mapping[str, Any], key: str, now: float | None, place: str
    ) -> None:
        if now is None:
            return
        if key not in readings:
            raise ReadingError(place, "is missing; it must be there where `now` is")
        age = now - _number(readings[key], place, np.inf)
        if abs(age) > self.max_age_s:
            when = f"{abs(age):.3f} s {'before' if age > 0 else 'after'} now"
            raise StaleReadingError(place, f"is {when}: must be at most {self.max_age_s:g} s away")

    def _write_victims(
        self, victims: Any, own: NDArray[np.float32], row: NDArray[np.float32]
    ) -> None:
        listed = type(victims) is list or isinstance(victims, Sequence)
        if not listed or isinstance(victims, str | bytes):
            raise ReadingError("victims", f"is {type(victims).__name__}: must be a list")
        if len(victims) > self._slots:
            raise ReadingError(
                "victims", f"has {len(victims)} entries: must have at most {self._slots}"
            )
        slots, tasks, places, times = [], [], [], []
        for slot, victim in enumerate(victims):
            if victim is None:
                continue
            place = f"victims.{slot}"
            body = _mapping(victim, place)
            _refuse_unknown(body, self._victim_keys, f"{place}.")
            task = _given(body, "task", f"{place}.")
            if not isinstance(task, str) or task not in self._needs:
                known = ", ".join(self._needs)
                raise ReadingError(f"{place}.task", f"is {_shown(task)}: known are {known}")
            places.append(_pair(body, "position", place, self._most_position_m))
            times.append([_share(body, one, f"{place}.") for one in self._times])
            slots.append(slot)
            tasks.append(task)
        if not slots:
            return
        relative = np.array(places, np.float32) - own
        if self._by_relevance:
            squares = relative * relative
            far = (squares[:, 0] + squares[:, 1]).tolist()
            order = sorted(range(len(tasks)), key=lambda i: (self._cannot_help[tasks[i]], far[i]))
            slots = list(range(len(tasks)))
        else:
            order = list(range(len(tasks)))
        blocks = row[self._victims_from :].reshape(self._slots, self._victim_width)
        for slot, index in zip(slots, order, strict=True):
            blocks[slot, : self._places_at] = self._needs[tasks[index]]
            blocks[slot, self._places_at :] = [*relative[index], *times[index]]


_MOST_SHOWN = 60
_SHARES = frozenset({"motor_gain", "speed_limit"})
"""Kinds of faults whose healthy value is 1; that of the others is 0."""


def _needed(needs: Sequence[str] | Mapping[str, float], ability: str) -> float:
    """How much of an ability is needed; of a list, how many robots."""
    if isinstance(needs, Mapping):
        return needs.get(ability, 0.0)
    return float(needs.count(ability))


def _given(readings: Mapping[str, Any], key: str, place: str = "") -> Any:
    try:
        return readings[key]
    except KeyError:
        raise ReadingError(f"{place}{key}", "is missing") from None


def _mapping(value: Any, place: str) -> Mapping[str, Any]:
    if type(value) is not dict and not isinstance(value, Mapping):
        raise ReadingError(place, f"is {type(value).__name__}: must be a mapping of names")
    return value


def _refuse_unknown(found: Mapping[str, Any], known: frozenset[str], place: str) -> None:
    if type(found) is not dict and not isinstance(found, Mapping):
        raise ReadingError(place or "readings", f"is {type(found).__name__}: must be a mapping")
    if not found.keys() <= known:
        name = next(key for key in found if key not in known)
        raise ReadingError(f"{place}{name}", f"is unknown; known are {', '.join(sorted(known))}")


def _pair(body: Mapping[str, Any], key: str, place: str, most: float) -> tuple[float, float]:
    """Two finite numbers within ``most`` of 0."""
    value = _given(body, key, f"{place}.")
    if isinstance(value, np.ndarray):
        value = value.tolist()
    try:
        x, y = value
    except (TypeError, ValueError):
        _refuse_pair(value, f"{place}.{key}")
    if type(x) is float and type(y) is float and abs(x) <= most and abs(y) <= most:
        return x, y
    return _number(x, f"{place}.{key}.x", most), _number(y, f"{place}.{key}.y", most)


def _share(body: Mapping[str, Any], key: str, place: str) -> float:
    """A number from 0 to 1."""
    value = _number(_given(body, key, place), f"{place}{key}", 1.0)
    if value < 0.0:
        raise ReadingError(f"{place}{key}", f"is {value}: must be a share from 0 to 1")
    return value


def _refuse_pair(value: Any, place: str) -> NoReturn:
    raise ReadingError(place, f"is {_shown(value)}: must be two numbers") from None


def _shown(value: Any) -> str:
    """A value for a message, cut where it is long; a whole number can be too long to be shown."""
    try:
        text = repr(value)
    except ValueError:
        text = f"a number of type {type(value).__name__}"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


def _number(value: Any, place: str, most: float) -> float:
    if type(value) is not float:
        if isinstance(value, bool) or not isinstance(value, _NUMBERS):
            raise ReadingError(place, f"is {_shown(value)}: must be a number")
        try:
            value = float(value)
        except OverflowError:
            value = math.inf if value > 0 else -math.inf
    if not (-most <= value <= most and abs(value) != np.inf):
        limit = "finite" if most == np.inf else f"within {most:g} of 0"
        raise ReadingError(place, f"is {value}: must be {limit}")
    found: float = value
    return found
