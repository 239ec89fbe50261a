"""Parquet files at the limits of what is read: no time and memory out of proportion."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from innerattn.errors import RunError
from innerattn.records import read_records, write_records
from innerattn.records.tables import read_table

FORM = "form"
META = {FORM: json.dumps({"schema_version": 1})}


def written(table: pa.Table, path: Path, **options: object) -> bytes:
    pq.write_table(table.replace_schema_metadata(META), path, **options)
    return path.read_bytes()


TABLES = {
    "columns": lambda: (pa.table({f"c{n}": [1] for n in range(10_000)}), {}),
    "row groups": lambda: (pa.table({"c": np.arange(20_000)}), {"row_group_size": 1}),
    "both": lambda: (
        pa.table({f"c{n}": np.arange(50) for n in range(400)}),
        {"row_group_size": 1},
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("table", TABLES)
def test_no_table_has_more_columns_than_are_counted_in_a_second(table: str, tmp_path: Path) -> None:
    made, options = TABLES[table]()
    data = written(made, tmp_path / "table", **options)
    with pytest.raises(RunError, match=r"must have at most 4000 in all|more than 500,000 fields"):
        read_table(data, Path("table"), FORM, 1)


def test_what_a_file_says_of_itself_has_a_length(tmp_path: Path) -> None:
    table = pa.table({"c": [1]}).replace_schema_metadata({**META, "more": "x" * (33 << 20)})
    pq.write_table(table, tmp_path / "table")
    with pytest.raises(RunError, match="not a file of form"):
        read_table((tmp_path / "table").read_bytes(), Path("table"), FORM, 1)


READ = """
import resource, sys
from pathlib import Path
from innerattn.errors import RunError
from innerattn.records.tables import read_table
data = Path(sys.argv[1]).read_bytes()
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    print(read_table(data, Path("table"), "form", 1)[0].num_rows)
except RunError as error:
    print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def read_apart(path: Path) -> tuple[str, int]:
    """What another process says of a table, and the memory that it took to read it [KiB]."""
    command = [sys.executable, "-c", READ, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    said, grown = done.stdout.splitlines()
    return said, int(grown)


@pytest.mark.long
def test_one_long_text_in_many_rows_is_not_written_out(tmp_path: Path) -> None:
    path = tmp_path / "table"
    written(pa.table({"c": pa.array(["x" * (1 << 20)] * 500)}), path)
    assert path.stat().st_size < 1 << 19
    said, grown = read_apart(path)
    assert said == "table: texts unpack to over 67108864 bytes: must be at most that many"
    assert grown < 100_000  # 500 MB as read by pyarrow


def test_texts_that_have_room_are_read(tmp_path: Path) -> None:
    texts = ["a", None, "b" * 1000, "a", "ä"] * 1000
    data = written(pa.table({"c": pa.array(texts)}), tmp_path / "table", row_group_size=2000)
    table, _ = read_table(data, Path("table"), FORM, 1)
    assert table["c"].type == pa.string()
    assert table["c"].to_pylist() == texts
    packed = pa.table({"c": pa.array(texts).dictionary_encode()})
    table, _ = read_table(written(packed, tmp_path / "packed"), Path("packed"), FORM, 1)
    assert table["c"].type == pa.string()
    assert table["c"].to_pylist() == texts


def test_texts_in_lists_are_refused(tmp_path: Path) -> None:
    data = written(pa.table({"c": pa.array([["a"], ["b", "c"]])}), tmp_path / "table")
    with pytest.raises(RunError, match="not a file of form") as caught:
        read_table(data, Path("table"), FORM, 1)
    assert "lists of texts" in str(caught.value.__cause__)


def test_values_of_a_fixed_size_are_refused(tmp_path: Path) -> None:
    """One of a megabyte could stand in each of thousands of rows, too."""
    wide = pa.array([b"x" * 1000] * 5, pa.binary(1000))
    data = written(pa.table({"c": wide}), tmp_path / "table")
    with pytest.raises(RunError, match="not a file of form") as caught:
        read_table(data, Path("table"), FORM, 1)
    assert "values of type FIXED_LEN_BYTE_ARRAY" in str(caught.value.__cause__)


def varint(number: int, length: int = 0) -> bytes:
    """A number of Thrift, zigzag, of at least some bytes."""
    number, found = number << 1, bytearray()
    while number > 0x7F or len(found) + 1 < length:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


def test_a_footer_that_names_smaller_pages_is_not_believed(tmp_path: Path) -> None:
    """The page holds 60 million numbers, the footer says 10."""
    path, count = tmp_path / "table", 60_000_000
    data = written(
        pa.table({"c": np.zeros(count, np.int32)}),
        path,
        use_dictionary=False,
        compression="zstd",
        data_page_size=1 << 30,
        write_batch_size=count,
        max_rows_per_page=count,
        row_group_size=count,
        write_statistics=False,
        store_schema=False,
    )
    end = len(data) - 8
    footer = data[end - int.from_bytes(data[end : end + 4], "little") : end]
    about = pq.ParquetFile(pa.BufferReader(data)).metadata.row_group(0).column(0)
    for found in (count, about.total_uncompressed_size):
        true = varint(found)
        assert true in footer
        footer = footer.replace(true, varint(10, len(true)))
    start = end - int.from_bytes(data[end : end + 4], "little")
    path.write_bytes(data[:start] + footer + data[end:])
    assert pq.read_metadata(path).num_rows == 10
    said, grown = read_apart(path)
    assert f"unpack to {about.total_uncompressed_size // 10**6}" in said
    assert grown < 50_000


def test_rows_stand_in_the_order_of_records(tmp_path: Path, run_dir: Path) -> None:
    records = read_records(run_dir / "evaluation", steps=False)
    write_records(records, tmp_path)
    path = tmp_path / "episodes.parquet"
    table = pq.read_table(path)
    turned = table.take(pa.array(np.arange(len(table))[::-1]))
    pq.write_table(turned.replace_schema_metadata(table.schema.metadata), path)
    with pytest.raises(RunError, match="rows must stand in the order of their records"):
        read_records(tmp_path)


def test_records_have_a_number(tmp_path: Path, run_dir: Path) -> None:
    records = read_records(run_dir / "evaluation", steps=False)[:1]
    write_records(records, tmp_path)
    for name in ("episodes.parquet", "rescues.parquet"):
        table = pq.read_table(tmp_path / name)
        head = json.loads(table.schema.metadata[b"innerattn.records"])
        head["records"] *= 1_001
        meta = {"innerattn.records": json.dumps(head)}
        pq.write_table(table.replace_schema_metadata(meta), tmp_path / name)
    with pytest.raises(RunError, match="1,001 records: must be at most 1,000"):
        read_records(tmp_path)
