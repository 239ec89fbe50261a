"""How large a Parquet file is when it is unpacked, by its footer and the heads of its pages.

pyarrow ends the whole process on some damaged footers when it is asked for a column's sizes, and
believes a page whose size is not that of the footer, so they are read here. Footer and heads are
structs in Thrift's compact protocol (https://github.com/apache/parquet-format).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

_MAGIC = b"PAR1"
_MOST_DEPTH = 16
_MOST_DIGITS = 10  # of seven bits: 64 bits
_MOST_FIELDS = 500_000
"""Fields and values of lists that are read, which take up to a second."""
_NUM_ROWS, _ROW_GROUPS, _COLUMNS, _META_DATA = 3, 4, 1, 3
_NUM_VALUES, _UNCOMPRESSED, _COMPRESSED, _DATA_PAGE, _DICTIONARY_PAGE = 5, 6, 7, 9, 11
_PAGE_UNCOMPRESSED, _PAGE_COMPRESSED = 2, 3


@dataclass(frozen=True)
class Sizes:
    """What a file says of itself.

    Attributes:
        rows: their number.
        row_groups: their number.
        columns: of all row groups together.
        values: of all columns together.
        unpacked_bytes: of all columns together, by the footer or by the heads of their pages,
            whichever says more.
    """

    rows: int
    row_groups: int
    columns: int
    values: int
    unpacked_bytes: int


def sizes_of(data: bytes) -> Sizes:
    """What a Parquet file says of its sizes.

    Args:
        data: the whole file.

    Raises:
        ValueError: it has no footer, one that is damaged or has over 500,000 fields, or pages that
            are not where it says.
    """
    end = len(data) - 8
    if end < 4 or data[-4:] != _MAGIC:
        raise ValueError("no footer of Parquet")
    length = int.from_bytes(data[end : end + 4], "little")
    if length > end - 4:
        raise ValueError("a footer longer than the file")
    reader = _Compact(data, end - length, end)
    footer = reader.struct(0)
    groups = _list(footer, _ROW_GROUPS)
    columns = [column for group in groups for column in _list(group, _COLUMNS)]
    sizes = [_struct(column, _META_DATA) for column in columns]
    claimed = sum(_number(one, _UNCOMPRESSED) for one in sizes)
    return Sizes(
        rows=_number(footer, _NUM_ROWS),
        row_groups=len(groups),
        columns=len(columns),
        values=sum(_number(one, _NUM_VALUES) for one in sizes),
        unpacked_bytes=max(claimed, sum(_pages_bytes(reader, one, end - length) for one in sizes)),
    )


def _pages_bytes(reader: _Compact, column: dict[int, Any], end: int) -> int:
    """Unpacked bytes of a column's pages, by their heads."""
    if not _number(column, _NUM_VALUES):  # its pages are not read
        return 0
    at = _number(column, _DATA_PAGE)
    if _DICTIONARY_PAGE in column:
        at = min(at, _number(column, _DICTIONARY_PAGE) or at)
    last, found = at + _number(column, _COMPRESSED), 0
    if last > end:
        raise ValueError("a column beyond the end")
    while at < last:
        head, at = reader.struct_at(at, last)
        found += _number(head, _PAGE_UNCOMPRESSED)
        at += _number(head, _PAGE_COMPRESSED)
    return found


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
    """A reader of Thrift's compact protocol: structs become dicts by number of field.

    It reads ``data`` between two places, and at most `_MOST_FIELDS` fields in all.
    """

    def __init__(self, data: bytes, at: int, end: int) -> None:
        self._data = data
        self._at, self._end = at, end
        self._fields = 0

    def struct_at(self, at: int, end: int) -> tuple[dict[int, Any], int]:
        """The struct that begins at a place, and where it ends."""
        self._at, self._end = at, end
        return self.struct(0), self._at

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
        self._fields += 1
        if self._fields > _MOST_FIELDS:
            raise ValueError(f"more than {_MOST_FIELDS:,} fields")
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
        if count > self._end - self._at:
            raise ValueError("a list longer than the footer")
        if kind in (1, 2):
            self._fields += count
            return [self._byte() == 1 for _ in range(count)]
        return [self._value(kind, depth + 1) for _ in range(count)]

    def _byte(self) -> int:
        return self._bytes(1)[0]

    def _bytes(self, count: int) -> bytes:
        found = self._data[self._at : min(self._at + count, self._end)]
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
