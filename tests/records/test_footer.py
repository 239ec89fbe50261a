"""Sizes in a footer equal pyarrow's; no damaged footer ends the process."""

import io
import os
import signal
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.errors import RunError
from innerattn.records.footer import sizes_of
from innerattn.records.tables import read_table

FORM = "form"


def written(rows: int, columns: int, group: int = 1_000) -> bytes:
    """A table of numbers, texts and lists as a file."""
    numbers = {f"n{i}": pa.array(np.arange(rows) % (i + 1)) for i in range(columns)}
    lists = pa.array([list(range(i % 4)) for i in range(rows)], pa.large_list(pa.int32()))
    table = pa.table({**numbers, "text": pa.array(["a b"] * rows), "list": lists})
    table = table.replace_schema_metadata({FORM: '{"schema_version": 1}'})
    sink = io.BytesIO()
    pq.write_table(table, sink, row_group_size=group)
    return sink.getvalue()


@given(st.integers(0, 60), st.integers(0, 20), st.integers(1, 30))
def test_sizes_are_those_that_pyarrow_reads(rows: int, columns: int, group: int) -> None:
    data = written(rows, columns, group)
    known = pq.ParquetFile(pa.BufferReader(data)).metadata
    chunks = [
        known.row_group(one).column(column)
        for one in range(known.num_row_groups)
        for column in range(known.num_columns)
    ]
    found = sizes_of(data)
    assert (found.row_groups, found.columns) == (known.num_row_groups, len(chunks))
    assert found.values == sum(chunk.num_values for chunk in chunks)
    assert found.unpacked_bytes == sum(chunk.total_uncompressed_size for chunk in chunks)


@given(st.binary(max_size=300))
def test_any_footer_is_read_or_refused(footer: bytes) -> None:
    data = b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1"
    try:
        found = sizes_of(data)
    except ValueError:
        return
    assert min(found.row_groups, found.columns, found.values, found.unpacked_bytes) >= 0


@pytest.mark.parametrize(
    "data", [b"", b"PAR1", b"PAR1" + (9).to_bytes(4, "little") + b"PAR1", written(3, 1)[:-1]]
)
def test_what_has_no_footer_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="footer"):
        sizes_of(data)


def test_deep_footers_are_refused() -> None:
    footer = b"\x1c" * 5_000  # structs in structs
    with pytest.raises(ValueError, match="deeply"):
        sizes_of(b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1")


@pytest.mark.parametrize("count", [300, pytest.param(5_000, marks=pytest.mark.slow)])
def test_no_flipped_bit_of_a_footer_ends_the_process(count: int) -> None:
    whole = written(50, 6)
    end = len(whole) - 8
    begin = end - int.from_bytes(whole[end : end + 4], "little")
    chance = np.random.default_rng(5)
    flips = np.stack([chance.integers(begin, end, count), chance.integers(0, 8, count)], axis=1)
    for some in np.split(flips, count // 50):
        assert code_of_reading(whole, some) == 0, f"one of {some.tolist()}"


def code_of_reading(whole: bytes, flips: np.ndarray) -> int:
    """0: each flip was read or refused. Another process reads, which pyarrow may end."""
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        try:
            for at, bit in flips:
                flipped = bytearray(whole)
                flipped[at] ^= 1 << int(bit)
                with suppress(RunError):
                    read_table(bytes(flipped), Path("file"), FORM, 1)
        except BaseException:
            os._exit(3)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
