"""Reads float32 arrays from a safetensors file with numpy alone; nothing is unpickled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from innerattn.config.untrusted import parse_json

if TYPE_CHECKING:
    from typing import TypeGuard  # of Python 3.10

_MOST_HEADER_BYTES = 1 << 20


def tensors_in(data: bytes) -> dict[str, NDArray[np.float32]]:
    """The arrays in the bytes of a safetensors file, by name; read-only views of ``data``.

    Raises:
        ValueError: the bytes are no such file, an array is not float32, or a value is not finite.
    """
    length = int.from_bytes(data[:8], "little")
    if len(data) < 8 or length > min(len(data) - 8, _MOST_HEADER_BYTES):
        raise ValueError(f"a header of {length} bytes: must be whole, at most {_MOST_HEADER_BYTES}")
    header = parse_json(data[8 : 8 + length])
    if not isinstance(header, dict):
        raise ValueError("the header is no object")
    body = memoryview(data)[8 + length :]
    found = {}
    for name, entry in header.items():
        if name != "__metadata__":
            found[name] = _tensor(name, entry, body)
    return found


def _tensor(name: str, entry: object, body: memoryview) -> NDArray[np.float32]:
    given = entry if isinstance(entry, dict) else {}
    shape, offsets = given.get("shape"), given.get("data_offsets")
    if given.get("dtype") != "F32" or not (_are_sizes(shape) and _are_sizes(offsets)):
        raise ValueError(f"{name}: must be a float32 array with a shape and two offsets")
    if len(offsets) != 2:
        raise ValueError(f"{name}: has {len(offsets)} offsets: must have two")
    begin, end = offsets
    if not 0 <= begin <= end <= len(body) or end - begin != 4 * math.prod(shape):
        raise ValueError(f"{name}: offsets {begin} to {end} do not fit its shape {shape}")
    values = np.frombuffer(body[begin:end], "<f4").reshape(shape)
    if not np.isfinite(values).all():
        raise ValueError(f"{name}: a value is not finite")
    return values


def _are_sizes(value: object) -> TypeGuard[list[int]]:
    """Whether it is a list of whole numbers of at least 0."""
    if not isinstance(value, list):
        return False
    return all(type(size) is int and size >= 0 for size in value)
