"""Outputs of smoke runs say so, and no others."""

from __future__ import annotations

import csv
import io

from matplotlib.figure import Figure

from innerattn.experiments.smoke import smoke_note
from innerattn.report.smoke import mark_figure, noted_csv, noted_markdown


def test_only_quick_is_no_result() -> None:
    assert "no result" in (smoke_note("quick") or "")
    assert smoke_note("short") is smoke_note("paper") is None


def test_text_has_the_note_at_its_top() -> None:
    text = noted_markdown("# Title\n", "quick")
    assert text.startswith("> **Budget quick: a smoke run, no result; ")
    assert text.endswith(".**\n\n# Title\n")
    assert noted_markdown("# Title\n", "short") == "# Title\n"


def test_tables_have_the_note_in_every_line_and_lose_nothing() -> None:
    table = 'name,value\n"a, ""b""",1\n"two\nlines",\n'
    rows = list(csv.DictReader(io.StringIO(noted_csv(table, "quick"))))
    assert rows == [
        {"name": 'a, "b"', "value": "1", "note": smoke_note("quick")},
        {"name": "two\nlines", "value": "", "note": smoke_note("quick")},
    ]
    assert noted_csv(table, "paper") == table


def test_figures_bear_it_across() -> None:
    assert [text.get_text() for text in mark_figure(Figure(), "quick").texts] == [
        "budget quick:\na smoke run,\nno result"
    ]
    assert mark_figure(Figure(), "short").texts == []
