"""Outputs of smoke runs say so, and no others."""

from __future__ import annotations

import csv
from pathlib import Path

from matplotlib.figure import Figure

from innerattn.experiments.smoke import smoke_note
from innerattn.report.folder import ReportFolder


def test_only_quick_is_no_result() -> None:
    assert "no result" in (smoke_note("quick") or "")
    assert smoke_note("short") is smoke_note("paper") is None


def test_text_has_the_note_at_its_top(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    ReportFolder(tmp_path, "quick").markdown(page.name, "# Title\n")
    text = page.read_text()
    assert text.startswith("> **Budget quick: a smoke run, no result; ")
    assert text.endswith(".**\n\n# Title\n")
    ReportFolder(tmp_path, "short").markdown(page.name, "# Title\n")
    assert page.read_text() == "# Title\n"


def test_tables_have_the_note_in_every_line_and_lose_nothing(tmp_path: Path) -> None:
    table = 'name,value\n"a, ""b""",1\n"two\nlines",\n'
    file = tmp_path / "table.csv"
    ReportFolder(tmp_path, "quick").csv(file.name, table)
    with file.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert rows == [
        {"name": 'a, "b"', "value": "1", "note": smoke_note("quick")},
        {"name": "two\nlines", "value": "", "note": smoke_note("quick")},
    ]
    ReportFolder(tmp_path, "paper").csv(file.name, table)
    assert file.read_text() == table


def test_figures_bear_it_across(tmp_path: Path) -> None:
    for budget, words in (("quick", ["budget quick:\na smoke run,\nno result"]), ("short", [])):
        figure = Figure()
        ReportFolder(tmp_path, budget).draw("drawn", figure)
        assert [text.get_text() for text in figure.texts] == words
        assert {path.name for path in tmp_path.iterdir()} == {"drawn.pdf", "drawn.png"}
