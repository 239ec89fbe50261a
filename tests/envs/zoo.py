"""More than a hundred arrays that a careless caller may give in place of a good one."""

import array
from collections.abc import Iterator
from typing import Any

import numpy as np

DTYPES = (
    *("?", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8", "g"),
    *("c8", "c16", "G", "O", "S8", "U8", "M8[s]", "m8[s]", "V8"),
    *(">i2", ">i4", ">i8", ">u2", ">u4", ">u8", ">f2", ">f4", ">f8", ">c8", ">M8[s]", ">U4"),
)


class Own(np.ndarray):
    """A subclass that says nothing new."""


class Liar(np.ndarray):
    """A subclass that lies about its shape to whoever asks in Python."""

    @property
    def shape(self) -> tuple[int, ...]:  # type: ignore[override]
        return (1,)


class Array:
    """Something that becomes an array when asked."""

    def __init__(self, given: Any) -> None:
        self.given = given

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        if isinstance(self.given, Exception):
            raise self.given
        return self.given


class Interface:
    """Something with numpy's older protocol."""

    def __init__(self, given: np.ndarray) -> None:
        self.kept = given
        self.__array_interface__ = given.__array_interface__


def zoo(good: np.ndarray) -> Iterator[tuple[str, Any]]:
    """Names and arrays made of a good one, some of them as good."""
    yield from _dtypes(good)
    yield from _layouts(good)
    yield from _shapes(good)
    yield from _values(good)
    yield from _objects(good)


def _dtypes(good: np.ndarray) -> Iterator[tuple[str, Any]]:
    for dtype in DTYPES:
        given = np.zeros(good.shape, dtype) if dtype[0] in "V" else None
        yield f"dtype {dtype}", good.astype(dtype) if given is None else given
    for byte in (2, 128, 255):
        bits = np.where(good.astype(bool), byte, 0).astype("u1")
        yield f"bool of bytes 0 and {byte}", bits.view(bool)
        yield f"strided bool of bytes 0 and {byte}", np.repeat(bits, 2, -1).view(bool)[..., ::2]
    yield "structured", np.zeros(good.shape, [("a", "i8"), ("b", "f4")])
    yield "complex with imaginary parts", good + 1j
    yield "objects of many kinds", np.full(good.shape, None)
    yield "object numbers", good.astype(object)
    yield "object floats", good.astype(float).astype(object)


def _layouts(good: np.ndarray) -> Iterator[tuple[str, Any]]:
    yield "itself", good
    yield "Fortran order", np.asfortranarray(good)
    yield "every second of wider rows", np.repeat(good, 2, axis=-1)[..., ::2]
    yield "every second of more rows", np.repeat(good, 2, axis=0)[::2]
    for axis in range(good.ndim):
        turned = np.ascontiguousarray(np.flip(good, axis))
        yield f"negative stride on axis {axis}", np.flip(turned, axis)
    yield "all strides negative", np.flip(np.ascontiguousarray(np.flip(good)))
    yield "all rows the same memory", np.broadcast_to(good[:1], good.shape)
    yield "one number everywhere", np.broadcast_to(good.ravel()[0], good.shape)
    raw = b"." + good.tobytes()
    yield "not aligned", np.frombuffer(raw, good.dtype, offset=1).reshape(good.shape)
    aligned = good.astype(good.dtype.newbyteorder("S"))
    yield "swapped bytes", aligned
    yield "swapped bytes, strided", np.repeat(aligned, 2, axis=0)[::2]
    locked = good.copy()
    locked.flags.writeable = False
    yield "read-only", locked
    yield "moved axes", np.moveaxis(np.ascontiguousarray(np.moveaxis(good, 0, -1)), -1, 0)
    packed = np.zeros(good.shape, [("pad", "u1"), ("x", good.dtype)])
    packed["x"] = good
    yield "a field of packed rows", packed["x"]


def _shapes(good: np.ndarray) -> Iterator[tuple[str, Any]]:
    yield "0-d", np.array(good.ravel()[0])
    yield "scalar", good.ravel()[0]
    yield "flat", np.append(good.ravel(), good.ravel())
    yield "one axis more before", good[None]
    yield "one axis more behind", good[..., None]
    yield "one axis less", good[0]
    yield "empty", good[:0]
    yield "empty rows", good[..., :0]
    yield "no axis of anything", np.zeros((0,), good.dtype)
    yield "too many", np.concatenate([good, good])
    yield "one too many", np.concatenate([good, good[:1]])
    yield "one too few", good[1:]
    yield "wider", np.repeat(good, 2, axis=-1)
    yield "32 axes", good.reshape((1,) * (32 - good.ndim) + good.shape)
    yield "turned", np.concatenate([good, good[:1]]).T
    yield "a row for all", good[:1]


def _values(good: np.ndarray) -> Iterator[tuple[str, Any]]:
    for place in (0, -1):
        for value in (np.nan, np.inf, -np.inf, 1e300, -1e300, 3e38, 0.5, 1.001, -1e-45):
            spoilt = good.astype("f8")
            spoilt.ravel()[place] = value
            yield f"f8 with {value} at {place}", spoilt
            if abs(value) < 1e300:
                yield f"f4 with {value} at {place}", spoilt.astype("f4")
        for whole in (-1, 5, 99, 2**31, -(2**31), 2**62, -(2**63)):
            spoilt = good.astype("i8")
            spoilt.ravel()[place] = whole
            yield f"i8 with {whole} at {place}", spoilt
        spoilt = good.astype("u8")
        spoilt.ravel()[place] = 2**64 - 1
        yield f"u8 with its most at {place}", spoilt


def _objects(good: np.ndarray) -> Iterator[tuple[str, Any]]:
    yield "nested lists", good.tolist()
    yield "nested tuples", tuple(map(tuple, good.tolist())) if good.ndim > 1 else tuple(good)
    yield "ragged lists", [*good.tolist()[:-1], [[1], [2, 3]]]
    yield "lists of text", [["1"] * 4] * len(good)
    yield "list of None", [None] * len(good)
    yield "generator", (row for row in good)
    yield "set", {1, 2}
    yield "dict", {"a": good}
    yield "nothing at all", Ellipsis
    yield "text", "actions"
    yield "bytes", good.tobytes()
    yield "memoryview", memoryview(good)
    yield "memoryview of bytes", memoryview(good.tobytes())
    yield "array.array", array.array("d", good.ravel().tolist())
    yield "a class", np.ndarray
    yield "its own protocol", Array(good)
    yield "its own protocol, complex", Array(good + 1j)
    yield "its own protocol, refused", Array(ValueError("not now"))
    yield "its own protocol, broken", Array(ZeroDivisionError("oh"))
    yield "its own protocol, no array", Array("text")
    yield "older protocol", Interface(good)
    yield "subclass", good.view(Own)
    yield "strided subclass", np.repeat(good, 2, axis=0).view(Own)[::2]
    yield "lying subclass", good.view(Liar)
    yield "records", np.rec.array(good) if good.dtype.names else good.view(np.recarray)
    if good.ndim <= 2:
        yield "matrix", np.asmatrix(good)
    yield "masked", np.ma.masked_array(good, np.zeros(good.shape, bool))
    yield "masked here and there", np.ma.masked_equal(good, good.ravel()[0])
    yield "all masked", np.ma.masked_all(good.shape, good.dtype)
    yield "masked constant", np.ma.masked
    yield "masked floats", np.ma.masked_invalid(good.astype(float))
