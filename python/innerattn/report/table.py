"""One model of a table, and its three forms: for a terminal, as Markdown and as CSV.

Cells are text already: what computes a number also rounds it. A form decides how a table looks,
never what it says.
"""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as RichTable

_WIDTH, _INDENT = 80, "  "  # of notes in a terminal
_VAST = 10_000  # a width that holds every table


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: its head.
        unit: unit of its values, shown behind the name; empty for none.
        right: whether its cells stand to the right, as numbers do.
    """

    name: str
    unit: str = ""
    right: bool = True

    @property
    def head(self) -> str:
        """The name with the unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes:
        cells: one for each column; missing ones at the end are empty.
        strong: whether it stands out, as the mean below its runs does.
    """

    cells: tuple[str, ...]
    strong: bool = False


@dataclass(frozen=True)
class Section:
    """Rows that belong together.

    Attributes:
        rows: from top to bottom.
        title: what they have in common; empty for no title.
    """

    rows: tuple[Row, ...]
    title: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        columns: from left to right.
        sections: from top to bottom.
        title: what it shows; empty where the text above says it.
        notes: what a reader needs to know besides, each a paragraph of its own.
    """

    columns: tuple[Column, ...]
    sections: tuple[Section, ...]
    title: str = ""
    notes: tuple[str, ...] = ()


def columns(words: Sequence[str], numbers: Sequence[str] = ()) -> tuple[Column, ...]:
    """Columns of words, which stand to the left, then columns of numbers, by their heads."""
    return (*(Column(name, right=False) for name in words), *map(Column, numbers))


def section(rows: Iterable[Row | Sequence[str]], title: str = "") -> Section:
    """A section of rows; those that are given as mere cells are not strong."""
    whole = (row if isinstance(row, Row) else Row(tuple(row)) for row in rows)
    return Section(tuple(whole), title)


def plain_table(
    columns: Sequence[Column],
    rows: Iterable[Row | Sequence[str]],
    title: str = "",
    notes: Sequence[str] = (),
) -> Table:
    """A table of one section."""
    return Table(tuple(columns), (section(rows),), title, tuple(notes))


def print_table(console: Console, table: Table, *, dense: bool = False) -> None:
    """Print a table with its title and its notes.

    Args:
        console: where to.
        table: what.
        dense: leave no room beside cells, for tables of many columns.
    """
    if table.title:
        console.print(table.title, style="bold", soft_wrap=True)
    drawn = _rich(table, dense)
    wanted = Measurement.get(console, console.options.update(width=_VAST), drawn).maximum
    drawn.collapse_padding = wanted > console.width
    console.print(drawn)
    for note in table.notes:
        console.print(_wrapped(note), soft_wrap=True)
    if table.notes:
        console.print()


def _wrapped(note: str) -> str:
    return textwrap.fill(
        note,
        _WIDTH,
        initial_indent=_INDENT,
        subsequent_indent=_INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _rich(table: Table, dense: bool) -> RichTable:
    drawn = RichTable(box=box.SIMPLE_HEAD, padding=0 if dense else (0, 1))
    for number, column in enumerate(table.columns):
        drawn.add_column(
            column.head,
            justify="right" if column.right else "left",
            overflow="fold",
            no_wrap=number == 0,
        )
    for number, part in enumerate(table.sections):
        if number:
            drawn.add_section()
        if part.title:
            drawn.add_row(part.title, style="bold")
        for row in part.rows:
            first, *rest = row.cells
            indent = _INDENT if part.title else ""
            drawn.add_row(indent + first, *rest, style="bold" if row.strong else None)
    return drawn


def markdown(table: Table) -> str:
    """A table as Markdown; it ends with a line break.

    A section's title is a row of its own; in strong rows the first cell is bold.
    """
    heads = [column.head for column in table.columns]
    rules = ["---:" if column.right else "---" for column in table.columns]
    lines = [_markdown_row(heads), _markdown_row(rules)]
    for part in table.sections:
        if part.title:
            lines.append(_markdown_row([_bold(part.title), *[""] * (len(heads) - 1)]))
        for row in part.rows:
            first, *rest = row.cells
            empty = [""] * (len(heads) - len(row.cells))
            lines.append(_markdown_row([_bold(first) if row.strong else first, *rest, *empty]))
    above = [f"**{table.title}**\n\n"] if table.title else []
    return "".join([*above, *lines, *(f"\n{note}\n" for note in table.notes)])


def _markdown_row(cells: Iterable[str]) -> str:
    escaped = (cell.replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |\n"


def _bold(text: str) -> str:
    return f"**{text}**" if text else ""


def csv_text(heads: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Values as CSV, unrounded; None is an empty field."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(rows)
    return text.getvalue()
