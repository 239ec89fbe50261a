"""How large the columns of a Parquet file say that they are, read from its footer alone.

pyarrow ends the whole process on some damaged footers when it is asked for a column's sizes, so
they are read here. The footer is one struct in Thrift's compact protocol
(https://github.com/apache/parquet-format, FileMetaData).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

_MAGIC = b"PAR1"
_MOST_DEPTH = 16
_MOST_DIGITS = 10  # of seven bits: 64 bits
_ROW_GROUPS, _COLUMNS, _META_DATA, _NUM_VALUES, _UNCOMPRESSED = 4, 1, 3, 5, 6


@dataclass(frozen=True)
class Sizes:
    """What a footer says.

    Attributes:
        row_groups: their number.
        columns: of all row groups together.
        values: of all columns together.
        unpacked_bytes: of all columns together.
    """

    row_groups: int
    columns: int
    values: int
    unpacked_bytes: int


def sizes_of(data: bytes) -> Sizes:
    """What the footer of a Parquet file says.

    Args:
        data: the whole file.

    Raises:
        ValueError: it has no footer, or one that is damaged.
    """
    end = len(data) - 8
    if end < 4 or data[-4:] != _MAGIC:
        raise ValueError("no footer of Parquet")
    length = int.from_bytes(data[end : end + 4], "little")
    if length > end - 4:
        raise ValueError("a footer longer than the file")
    footer = _Compact(data[end - length : end]).struct(0)
    groups = _list(footer, _ROW_GROUPS)
    columns = [column for group in groups for column in _list(group, _COLUMNS)]
    sizes = [_struct(column, _META_DATA) for column in columns]
    return Sizes(
        row_groups=len(groups),
        columns=len(columns),
        values=sum(_number(one, _NUM_VALUES) for one in sizes),
        unpacked_bytes=sum(_number(one, _UNCOMPRESSED) for one in sizes),
    )


def _list(fields: Any, key: int) -> list[Any]:
    found = fields.get(key) if isinstance(fields, dict) else None
    if not isinstance(found, list):
        raise ValueError("a list is missing")
    return found


def _struct(fields: Any, key: int) -> dict[int, Any]:
    found = fields.get(key) if isinstance(fields, dict) else None
    if not isinstance(found, dict):
        raise ValueError("a column without its description")
    return found


def _number(fields: dict[int, Any], key: int) -> int:
    found = fields.get(key)
    if not isinstance(found, int) or isinstance(found, bool) or found < 0:
        raise ValueError("a size is missing or below 0")
    return found


class _Compact:
    """A reader of Thrift's compact protocol: structs become dicts by number of field."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def struct(self, depth: int) -> dict[int, Any]:
        if depth > _MOST_DEPTH:
            raise ValueError("nested too deeply")
        fields: dict[int, Any] = {}
        number = 0
        while head := self._byte():
            step, kind = head >> 4, head & 0x0F
            number = number + step if step else self._zigzag()
            fields[number] = kind == 1 if kind in (1, 2) else self._value(kind, depth)
        return fields

    def _value(self, kind: int, depth: int) -> Any:
        if kind == 3:
            return self._byte()
        if kind in (4, 5, 6):
            return self._zigzag()
        if kind == 7:
            return self._bytes(8)
        if kind == 8:
            return self._bytes(self._varint())
        if kind in (9, 10):
            return self._values(depth)
        if kind == 12:
            return self.struct(depth + 1)
        raise ValueError(f"a field of kind {kind}, which Parquet has not")

    def _values(self, depth: int) -> list[Any]:
        head = self._byte()
        count, kind = head >> 4, head & 0x0F
        if count == 15:
            count = self._varint()
        if count > len(self._data) - self._at:
            raise ValueError("a list longer than the footer")
        if kind in (1, 2):
            return [self._byte() == 1 for _ in range(count)]
        return [self._value(kind, depth + 1) for _ in range(count)]

    def _byte(self) -> int:
        return self._bytes(1)[0]

    def _bytes(self, count: int) -> bytes:
        found = self._data[self._at : self._at + count]
        if len(found) != count:
            raise ValueError("the footer is cut")
        self._at += count
        return found

    def _varint(self) -> int:
        found = 0
        for place in range(_MOST_DIGITS):
            byte = self._byte()
            found |= (byte & 0x7F) << (7 * place)
            if byte < 0x80:
                return found
        raise ValueError("a number of more than 64 bits")

    def _zigzag(self) -> int:
        found = self._varint()
        return (found >> 1) ^ -(found & 1)
