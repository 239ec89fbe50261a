"""Checks of what readings hold: mappings, lists, pairs and numbers, each refused by its name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import numpy as np

from innerattn.errors import ReadingError

_NUMBERS = (float, int, np.floating, np.integer)
_MOST_SHOWN = 60


def given(readings: Mapping[str, Any], key: str, place: str = "") -> Any:
    """The value of a key that must be there."""
    try:
        return readings[key]
    except KeyError:
        raise ReadingError(f"{place}{key}", "is missing") from None


def mapping(value: Any, place: str) -> Mapping[str, Any]:
    """A mapping of names."""
    if type(value) is not dict and not isinstance(value, Mapping):
        raise ReadingError(place, f"is {type(value).__name__}: must be a mapping of names")
    return value


def listed(value: Any, place: str) -> Sequence[Any]:
    """A list, or what is like one."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if type(value) is list or (isinstance(value, Sequence) and not isinstance(value, (str, bytes))):
        return value
    raise ReadingError(place, f"is {type(value).__name__}: must be a list")


def refuse_unknown(found: Mapping[str, Any], known: frozenset[str], place: str) -> None:
    """Refuse keys that nobody reads."""
    if type(found) is not dict and not isinstance(found, Mapping):
        raise ReadingError(place or "readings", f"is {type(found).__name__}: must be a mapping")
    if not found.keys() <= known:
        name = next(key for key in found if key not in known)
        raise ReadingError(f"{place}{name}", f"is unknown; known are {', '.join(sorted(known))}")


def pair(body: Mapping[str, Any], key: str, place: str, most: float) -> tuple[float, float]:
    """Two finite numbers within ``most`` of 0."""
    value = given(body, key, f"{place}.")
    if isinstance(value, np.ndarray):
        value = value.tolist()
    try:
        x, y = value
    except (TypeError, ValueError):
        _refuse_pair(value, f"{place}.{key}")
    if type(x) is float and type(y) is float and abs(x) <= most and abs(y) <= most:
        return x, y
    return number(x, f"{place}.{key}.x", most), number(y, f"{place}.{key}.y", most)


def share(body: Mapping[str, Any], key: str, place: str) -> float:
    """A number from 0 to 1."""
    value = number(given(body, key, place), f"{place}{key}", 1.0)
    if value < 0.0:
        raise ReadingError(f"{place}{key}", f"is {value}: must be a share from 0 to 1")
    return value


def not_negative(value: Any, place: str) -> float:
    """A finite number of at least 0."""
    found = number(value, place, math.inf)
    if found < 0.0:
        raise ReadingError(place, f"is {found}: must be at least 0")
    return found


def number(value: Any, place: str, most: float) -> float:
    """A finite number within ``most`` of 0."""
    if type(value) is not float:
        if isinstance(value, bool) or not isinstance(value, _NUMBERS):
            raise ReadingError(place, f"is {shown(value)}: must be a number")
        try:
            value = float(value)
        except OverflowError:
            value = math.inf if value > 0 else -math.inf
    if not (-most <= value <= most and abs(value) != np.inf):
        limit = "finite" if most == np.inf else f"within {most:g} of 0"
        raise ReadingError(place, f"is {value}: must be {limit}")
    found: float = value
    return found


def shown(value: Any) -> str:
    """A value for a message, cut where it is long; a whole number can be too long to be shown."""
    try:
        text = repr(value)
    except ValueError:
        text = f"a number of type {type(value).__name__}"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


def _refuse_pair(value: Any, place: str) -> NoReturn:
    raise ReadingError(place, f"is {shown(value)}: must be two numbers") from None
