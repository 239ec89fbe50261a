"""Files that may be damaged or hostile: plain ones of a bounded size, and JSON in them.

Every limit is checked before memory or time is spent on what lies beyond it. It knows no key.
"""

from __future__ import annotations

import json
import math
import os
import stat
from pathlib import Path
from typing import Any, NoReturn

from innerattn.errors import RunError

MOST_JSON_BYTES = 16 << 20
MOST_TOML_BYTES = 1 << 20
MOST_DEPTH = 64
_MOST_DIGITS = 40
_FREE_BYTES = 16 << 20
_MOST_MEMORY = 20
"""Most bytes of memory for each byte of a JSON text, past `_FREE_BYTES`."""
_COSTS = {b"[": 72, b"{": 80, b",": 64, b":": 160}
"""Bytes of memory that a value costs at most beside its text, by the sign that comes with it."""


def read_plain(path: Path, most_bytes: int, *, follow_link: bool = False) -> bytes:
    """The bytes of a plain file, read once and whole.

    Args:
        path: the file.
        most_bytes: how long it may be.
        follow_link: whether ``path`` may be a link to the file.

    Raises:
        RunError: it is missing, a link, a folder, a pipe or a device, or longer than that.
        OSError: it cannot be read.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
    flags |= getattr(os, "O_BINARY", 0)
    if not follow_link:
        flags |= getattr(os, "O_NOFOLLOW", 0)
        if path.is_symlink():
            raise _not_plain(path)
    try:
        descriptor = os.open(path, flags)
    except PermissionError:
        raise
    except OSError as error:
        raise _not_plain(path) from error
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode):
        os.close(descriptor)
        raise _not_plain(path)
    with os.fdopen(descriptor, "rb") as file:
        if found.st_size > most_bytes:
            raise RunError(f"{path}: has {found.st_size} bytes: must have at most {most_bytes}")
        data = file.read(found.st_size + 1)
    if len(data) != found.st_size:
        raise RunError(f"{path}: grew or shrank while it was read")
    return data


def parse_json(text: str | bytes) -> Any:
    """The document in a JSON text, without what Python's own reader adds to JSON.

    Raises:
        ValueError: it is no JSON, names a key of an object twice, is nested more than 64 deep,
            holds a number that is not finite or has more than 40 digits, or holds so many tiny
            values that they take over 20 times the memory of their text.
    """
    _refuse_dense(text)
    try:
        document = json.loads(
            text,
            parse_int=_whole_number,
            parse_float=_finite_number,
            parse_constant=_no_number,
            object_pairs_hook=_no_key_twice,
        )
    except RecursionError as error:
        raise ValueError(f"is nested more than {MOST_DEPTH} deep") from error
    refuse_deep(document)
    return document


def _not_plain(path: Path) -> RunError:
    return RunError(f"{path}: missing, or not a plain file")


def _whole_number(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"a number has {len(text)} digits: must have at most {_MOST_DIGITS}")
    return int(text)


def _finite_number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:_MOST_DIGITS]} is not finite")
    return value


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a number of JSON")


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        seen = set[str]()
        twice = next(name for name, _ in pairs if name in seen or seen.add(name))  # type: ignore[func-returns-value]
        raise ValueError(f"the key {twice[:_MOST_DIGITS]!r} comes twice")
    return found


def _refuse_dense(text: str | bytes) -> None:
    """Refuse a text of tiny values, each of which takes much more memory than its text."""
    data = text.encode() if isinstance(text, str) else text
    memory = sum(cost * data.count(sign) for sign, cost in _COSTS.items())
    if memory > max(_FREE_BYTES, _MOST_MEMORY * len(data)):
        raise ValueError(
            f"takes up to {memory:,} bytes of memory: must be at most {_MOST_MEMORY} times its "
            f"{len(data):,} bytes"
        )


def refuse_deep(document: Any) -> None:
    """Refuse nesting and whole numbers that no document of ours has."""
    level = [document]
    for _ in range(MOST_DEPTH):
        nested: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                nested += value.values()
            elif isinstance(value, list):
                nested += value
            elif isinstance(value, int) and abs(value) >= 10**_MOST_DIGITS:
                raise ValueError(f"a number has more than {_MOST_DIGITS} digits")
        if not nested:
            return
        level = nested
    raise ValueError(f"is nested more than {MOST_DEPTH} deep")
