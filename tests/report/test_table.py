"""One table in its three forms: every cell is there, in its place, and set off as it should be."""

import csv
import io
import re

from markdown_rows import rows_of
from rich.console import Console

from innerattn.report.table import (
    Column,
    Row,
    Table,
    columns,
    csv_text,
    markdown,
    plain_table,
    print_table,
    section,
)

TABLE = Table(
    (Column("method", right=False), Column("time", "s"), Column("score")),
    (
        section([["td-inner", "1.25", "0.8"], ["ppo", "10", "-"]], "mixed"),
        section([Row(("mean", "5.6"), strong=True)]),
    ),
    "What was measured",
    ("score: higher is better", "a/very/" + "long/" * 20 + "path"),
)


def printed(table: Table, *, dense: bool = False) -> list[str]:
    out = io.StringIO()
    console = Console(file=out, width=60, markup=False, highlight=False)
    print_table(console, table, dense=dense)
    return out.getvalue().splitlines()


def test_in_a_terminal() -> None:
    lines = printed(TABLE)
    assert lines[0] == "What was measured"
    cells = [line.split() for line in lines[1:]]
    assert cells[1] == ["method", "time", "[s]", "score"]
    assert [row for row in cells[3:] if row][:4] == [
        ["mixed"],
        ["td-inner", "1.25", "0.8"],
        ["ppo", "10", "-"],
        ["mean", "5.6"],
    ]
    ends = [line.rstrip() for line in lines]
    (inner,) = [line for line in ends if "td-inner" in line]
    (ppo,) = [line for line in ends if "ppo" in line]
    assert inner.index("td-inner") == ppo.index("ppo")  # words stand to the left
    assert inner.index("1.25") + 4 == ppo.index("10") + 2  # numbers to the right
    assert inner.index("td-inner") > ends[4].index("mixed")
    assert lines[-3:] == [f"  {note}" for note in TABLE.notes] + [""]  # a path is never broken
    assert max(map(len, printed(TABLE, dense=True)[:-3])) < max(map(len, lines[:-3]))


def test_columns_move_together_before_a_cell_is_wrapped() -> None:
    def lines(last: str) -> list[str]:
        wide = ["ppo-inner", *["11.15 ± 0.14"] * 2, last]
        return printed(plain_table(columns(["policy"], "abc"), [wide]))

    cell = "11.15 ± 0.14"
    assert f"  ppo-inner   {cell}   {cell}   0.84 ± 0.001  " in lines("0.84 ± 0.001")
    assert f"  ppo-inner  {cell}  {cell}  0.84 ± 0.0012345  " in lines("0.84 ± 0.0012345")


def test_long_notes_are_wrapped() -> None:
    note = "word " * 40
    lines = [line for line in printed(plain_table(columns(["a"]), [["b"]], notes=[note])) if line]
    wrapped = [line for line in lines if "word" in line]
    assert len(wrapped) > 1
    assert all(line.startswith("  word") and len(line) <= 80 for line in wrapped)
    assert " ".join(wrapped).split() == note.split()


def test_strong_rows_and_titles_are_bold() -> None:
    out = io.StringIO()
    print_table(Console(file=out, width=60, force_terminal=True, no_color=True), TABLE)
    bold = [line for line in out.getvalue().splitlines() if "\x1b[1m" in line]
    text = re.sub("\x1b[^m]*m", "", "\n".join(bold))
    assert all(word in text for word in ("What was measured", "mixed", "mean"))
    assert "td-inner" not in text


def test_as_markdown() -> None:
    text = markdown(TABLE)
    title, head, rule, *rows = text.split("\n\n")[0:1] + text.split("\n\n")[1].splitlines()
    assert title == "**What was measured**"
    assert head == "| method | time [s] | score |"
    assert rule == "| --- | ---: | ---: |"
    assert rows == [
        "| **mixed** |  |  |",
        "| td-inner | 1.25 | 0.8 |",
        "| ppo | 10 | - |",
        "| **mean** | 5.6 |  |",
    ]
    assert text.endswith(f"\n\n{TABLE.notes[0]}\n\n{TABLE.notes[1]}\n")


def test_bars_in_cells_do_not_end_them() -> None:
    cells = ["|x|", "a | b"]
    text = markdown(plain_table(columns(["|", "c"]), [cells]))
    assert rows_of(text) == [["|", "c"], cells]


def test_as_csv() -> None:
    rows = [("a,b", 0.1 + 0.2, None), ('"', 1, True)]
    text = csv_text(["x", "y", "z"], rows)
    assert list(csv.reader(io.StringIO(text))) == [
        ["x", "y", "z"],
        ["a,b", "0.30000000000000004", ""],
        ['"', "1", "True"],
    ]
