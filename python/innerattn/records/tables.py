"""Parquet tables as bytes. Sizes are checked before they are unpacked: nobody vouches for them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from innerattn.config.untrusted import parse_json
from innerattn.errors import RunError
from innerattn.records.footer import sizes_of

MOST_FILE_BYTES = 4 << 30
_LEAST_LIMIT_BYTES = 64 << 20
"""A table may always take this much."""
_MOST_RATIO = 200
"""A larger table may take this many times the size of its file."""
_MOST_COLUMNS = 10_000
_MOST_ROW_GROUPS = 100_000
_MOST_TEXT_BYTES = 64 << 20


def read_table(
    data: bytes, path: Path, form: str, version: int, columns: Sequence[str] | None = None
) -> tuple[pa.Table, dict[str, Any]]:
    """Some columns of a table, or all, and what the file says of itself.

    Args:
        data: the file.
        path: where it lies, for messages.
        form: the name of its format, under which the file describes itself.
        version: the schema version that is known.
        columns: which columns; None: all.

    Raises:
        RunError: it is no Parquet, of another format or version, or would unpack to more than 64
            MiB and 200 times its size.
    """
    try:
        with _opened(data) as file:
            _refuse_large(file.metadata.num_rows, data, path)
            found = file.schema_arrow.metadata or {}
            head = parse_json(found[form.encode()])
            known = head["schema_version"]
            table = file.read(columns)
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise RunError(f"{path}: not a file of {form}") from error
    if known != version:
        raise RunError(f"{path}: schema version {known}, only {version} is known")
    return table, head


def table_bytes(table: pa.Table, compression_level: int | None = None) -> bytes:
    """A table as a Parquet file that `read_table` reads.

    Numbers that repeat so much that they would unpack to more than it allows are not packed.
    """
    packed = _written(table, compression="zstd", compression_level=compression_level)
    try:
        refuse_damaged(packed, Path())
    except RunError:
        return _written(table, compression="none", use_dictionary=False)
    return packed


def _written(table: pa.Table, **options: Any) -> bytes:
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, **options)
    data: bytes = sink.getvalue().to_pybytes()
    return data


def refuse_damaged(data: bytes, path: Path) -> None:
    """Refuse bytes whose end is not that of a Parquet file of a bearable size.

    Raises:
        RunError: they are none.
    """
    try:
        with _opened(data) as file:
            _refuse_large(file.metadata.num_rows, data, path)
    except (OSError, pa.ArrowException) as error:
        raise RunError(f"{path}: not a whole Parquet file") from error


def _opened(data: bytes) -> pq.ParquetFile:
    return pq.ParquetFile(
        pa.BufferReader(data),
        thrift_string_size_limit=_MOST_TEXT_BYTES,
        thrift_container_size_limit=_MOST_ROW_GROUPS * 10,
    )


def _refuse_large(rows: int, data: bytes, path: Path) -> None:
    """Refuse a table that would be much larger than its file, by what the file says of it."""
    try:
        sizes = sizes_of(data)
    except ValueError as error:
        raise RunError(f"{path}: not a whole Parquet file ({error})") from error
    columns, groups = sizes.columns // max(1, sizes.row_groups), sizes.row_groups
    if columns > _MOST_COLUMNS or groups > _MOST_ROW_GROUPS:
        raise RunError(
            f"{path}: has {columns} columns in {groups} row groups: must have at most "
            f"{_MOST_COLUMNS} in {_MOST_ROW_GROUPS}"
        )
    size = len(data)
    most = max(_LEAST_LIMIT_BYTES, _MOST_RATIO * size)
    # Repeated values take no room in a file; a number takes eight bytes in memory.
    needed = max(sizes.unpacked_bytes, 8 * sizes.values, 8 * rows)
    if needed > most:
        raise RunError(f"{path}: {size} bytes unpack to {needed}: must be at most {most}")
