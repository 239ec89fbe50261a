"""Readers of plain data: what JSON holds becomes tuples, numbers and dataclasses, each checked.

They know no format. What cannot be is refused with its place, its value and what it must be. The
standard library alone is needed, so that a robot needs no more.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from typing import Any

from innerattn.policies.exported.values import shown

Read = Callable[[Any, str], Any]
"""Takes a value and its place; gives what it means, or raises a `ValueError`."""


def anything(value: Any, _: str) -> Any:
    """A value as it is."""
    return value


def text(pattern: str = "", meaning: str = "") -> Read:
    """Texts; those that a pattern matches as a whole, which ``meaning`` says in words."""

    def read(value: Any, place: str) -> str:
        if not isinstance(value, str):
            raise _refused(value, place, meaning or "a text")
        if pattern and re.fullmatch(pattern, value) is None:
            raise _refused(value, place, meaning)
        try:
            value.encode()
        except UnicodeEncodeError:
            raise _refused(value, place, "a text without halves of characters") from None
        return value

    return read


def one_of(*words: str | int) -> Read:
    """One of some words or whole numbers."""

    def read(value: Any, place: str) -> str | int:
        for word in words:
            if type(value) is type(word) and value == word:
                return word
        raise _refused(value, place, " or ".join(map(repr, words)))

    return read


def flag(value: Any, place: str) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise _refused(value, place, "true or false")
    return value


def whole(least: int, below: int | None = None) -> Read:
    """Whole numbers from ``least`` to below ``below``."""
    end = "" if below is None else f" and below {below:,}"

    def read(value: Any, place: str) -> int:
        is_one = isinstance(value, int) and not isinstance(value, bool)
        if not is_one or value < least or (below is not None and value >= below):
            raise _refused(value, place, f"a whole number of at least {least}{end}")
        found: int = value
        return found

    return read


def number(
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
) -> Read:
    """Finite numbers in a range, as float."""
    ends = [("above", above), ("at least", least), ("at most", most), ("below", below)]
    said = " and ".join(f"{word} {end:g}" for word, end in ends if math.isfinite(end))
    meaning = f"a finite number{' ' if said else ''}{said}"

    def read(value: Any, place: str) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise _refused(value, place, meaning)
        try:
            found = float(value)
        except OverflowError:
            found = math.inf
        if not (math.isfinite(found) and above < found < below and least <= found <= most):
            raise _refused(value, place, meaning)
        return found

    return read


def optional(of: Read) -> Read:
    """None, or what another reader takes."""
    return lambda value, place: None if value is None else of(value, place)


def many(of: Read, least: int = 0, most: int | None = None) -> Read:
    """Lists of values of one sort, as tuples."""
    end = "" if most is None else f" and at most {most}"

    def read(value: Any, place: str) -> tuple[Any, ...]:
        found = _listed(value, place)
        if len(found) < least or (most is not None and len(found) > most):
            said = f"has {len(found)} entries: must have at least {least}{end}"
            raise ValueError(f"{place}: {said}")
        return tuple(of(one, _at(place, index)) for index, one in enumerate(found))

    return read


def pair(of: Read) -> Read:
    """Two values of one sort, as a tuple."""
    return many(of, 2, 2)


def table(of: Read, key: Read | None = None) -> Read:
    """Tables by name, as dictionaries."""
    name = key or text()

    def read(value: Any, place: str) -> dict[str, Any]:
        found = _mapped(value, place)
        return {name(one, place): of(entry, _at(place, one)) for one, entry in found.items()}

    return read


def list_or_table(listed: Read, mapped: Read) -> Read:
    """What one of two readers takes: that of lists, or that of tables."""
    return lambda value, place: (mapped if isinstance(value, Mapping) else listed)(value, place)


def record(kind: type[Any], /, **readers: Read) -> Read:
    """Tables with the fields of a dataclass, as that; a field with a default may be missing.

    Args:
        kind: the dataclass.
        **readers: of each of its fields, in their order.

    Raises:
        TypeError: the readers are not those of its fields.
    """
    if list(readers) != [field.name for field in fields(kind)]:
        raise TypeError(f"{kind.__name__}: has other fields than {', '.join(readers)}")
    needed = {
        field.name
        for field in fields(kind)
        if field.default is MISSING and field.default_factory is MISSING
    }

    def read(value: Any, place: str) -> Any:
        found = _mapped(value, place)
        for name in found:
            if name not in readers:
                known = ", ".join(readers)
                raise ValueError(f"{_at(place, _shown_key(name))}: is unknown; known are {known}")
        for name in readers:
            if name in needed and name not in found:
                raise ValueError(f"{_at(place, name)}: is missing")
        given = {name: of for name, of in readers.items() if name in found}
        return kind(**{name: of(found[name], _at(place, name)) for name, of in given.items()})

    return read


def _shown_key(name: Any) -> str:
    """A name for a message, cut where it is long."""
    return shown(name)[1:-1] if isinstance(name, str) else shown(name)


def _mapped(value: Any, place: str) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise _refused(value, place, "a table")
    return value


def _listed(value: Any, place: str) -> Any:
    if not isinstance(value, (list, tuple)):
        raise _refused(value, place, "a list")
    return value


def _refused(value: Any, place: str, meaning: str) -> ValueError:
    return ValueError(f"{place or 'the document'}: is {shown(value)}: must be {meaning}")


def _at(place: str, name: Any) -> str:
    return f"{place}.{name}" if place else str(name)
