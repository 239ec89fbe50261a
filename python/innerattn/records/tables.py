"""Parquet tables as bytes. Sizes are checked before they are unpacked: nobody vouches for them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from innerattn.config.untrusted import parse_json
from innerattn.errors import RunError
from innerattn.records.footer import sizes_of

MOST_FILE_BYTES = 4 << 30
_LEAST_LIMIT_BYTES = 64 << 20
"""A table may always take this much."""
_MOST_RATIO = 200
"""A larger table may take this many times the size of its file."""
_MOST_COLUMNS = 4_000
"""In all row groups together."""
_MOST_TEXT_BYTES = 16 << 20
_TEXT = "BYTE_ARRAY"
_NUMBERS = frozenset({"BOOLEAN", "INT32", "INT64", "FLOAT", "DOUBLE"})
"""Physical types of at most eight bytes a value."""


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
    _refuse_large(data, path)
    try:
        with _opened(data) as file:
            found = file.schema_arrow.metadata or {}
            head = parse_json(found[form.encode()])
            known = head["schema_version"]
            texts = _texts(file.schema)
        # Texts are read as numbers of a list of texts: one may stand in millions of rows.
        with _opened(data, read_dictionary=texts) as file:
            table = _written_out(file.read(columns), _most_bytes(data), path)
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
    _refuse_large(data, path)
    try:
        with _opened(data):
            pass
    except (OSError, pa.ArrowException) as error:
        raise RunError(f"{path}: not a whole Parquet file") from error


def _opened(data: bytes, **options: Any) -> pq.ParquetFile:
    return pq.ParquetFile(
        pa.BufferReader(data),
        thrift_string_size_limit=2 * _MOST_TEXT_BYTES,  # pyarrow keeps them a second time
        thrift_container_size_limit=10 * _MOST_COLUMNS,
        **options,
    )


def _texts(schema: pq.ParquetSchema) -> list[str]:
    """Names of the columns of texts.

    Raises:
        ValueError: texts lie in lists, or a column holds neither numbers nor texts.
    """
    columns = [schema.column(place) for place in range(len(schema))]
    for one in columns:
        if one.physical_type not in (_TEXT, *_NUMBERS):
            raise ValueError(f"column {one.path}: values of type {one.physical_type}")
    texts = [one for one in columns if one.physical_type == _TEXT]
    for one in texts:
        if one.max_repetition_level:
            raise ValueError(f"column {one.path}: lists of texts")
    return [one.path for one in texts]


def _written_out(table: pa.Table, most: int, path: Path) -> pa.Table:
    """The table with each text in its row, if that has room."""
    needed = 0
    for place, field in enumerate(table.schema):
        if not pa.types.is_dictionary(field.type):
            continue
        column = table.column(place)
        lengths = (pc.binary_length(one.dictionary).take(one.indices) for one in column.chunks)
        needed += sum(pc.sum(one).as_py() or 0 for one in lengths)
        if needed > most:
            raise RunError(f"{path}: texts unpack to over {most} bytes: must be at most that many")
        table = table.set_column(
            place, pa.field(field.name, field.type.value_type), column.cast(field.type.value_type)
        )
    return table


def _most_bytes(data: bytes) -> int:
    return max(_LEAST_LIMIT_BYTES, _MOST_RATIO * len(data))


def _refuse_large(data: bytes, path: Path) -> None:
    """Refuse a table that would be much larger than its file, by what the file says of it."""
    try:
        sizes = sizes_of(data)
    except ValueError as error:
        raise RunError(f"{path}: not a whole Parquet file ({error})") from error
    if sizes.columns > _MOST_COLUMNS:
        raise RunError(
            f"{path}: has {sizes.columns} columns in {sizes.row_groups} row groups: must have at "
            f"most {_MOST_COLUMNS} in all of them together"
        )
    most = _most_bytes(data)
    # Repeated values take no room in a file; a number takes eight bytes in memory.
    needed = max(sizes.unpacked_bytes, 8 * sizes.values, 8 * sizes.rows)
    if needed > most:
        raise RunError(f"{path}: {len(data)} bytes unpack to {needed}: must be at most {most}")
