"""Each row of the scoreboard names tests that are there, and the page shows every row."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from markdown_rows import rows_of
from reliability import Result, line_of, main, run_row
from reliability_rows import ROWS, Row

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_the_tests_of_a_row_are_there(row: Row) -> None:
    assert row.python or row.rust or row.missing
    for one in row.python:
        path, _, function = one.partition("::")
        text = (ROOT / path).read_text("utf-8")
        assert not function or f"\ndef {function}(" in text, one
    for one in row.rust:
        module, _, part = one.partition("::")
        text = (ROOT / f"rust_env/tests/worlds/{module}.rs").read_text("utf-8")
        assert re.search(rf"\nfn {part}\w*\(", text), one


def test_the_page_shows_every_row() -> None:
    shown = rows_of((ROOT / "docs" / "reliability.md").read_text("utf-8"))
    assert [row[0] for row in shown if len(row) == 5][1:] == [row.name for row in ROWS]


def test_a_row_with_a_failed_or_skipped_test_does_not_hold(tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(
        "import pytest\n"
        "def test_good(): pass\n"
        "def test_bad(): assert False\n"
        "def test_skipped(): pytest.skip('no')\n"
    )
    place = str(tmp_path / "test_some.py")
    good, all_ = (run_row(Row("x", "", (one,))) for one in (f"{place}::test_good", place))
    assert (good.passed, good.failed) == (1, 0)
    assert (all_.passed, all_.failed) == (1, 2)
    assert line_of(Row("x", "."), good)[2:4] == ["yes", "1"]
    assert line_of(Row("x", "."), all_)[2:4] == ["**no**", "1, 2 failed"]
    assert line_of(Row("x", ".", missing="it"), good)[1:3] == [". Not tested: it.", "**no**"]
    assert line_of(Row("x", "."), Result(0, 0, 1.0))[2] == "**no**"
    assert line_of(Row("x", "."), None)[2:] == ["not run in full", "", ""]


def test_what_a_test_measures_is_shown(tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(
        "import pytest\n"
        "@pytest.mark.parametrize('took', [0.5, 0.25, 4.0])\n"
        "def test_good(took, record_property): record_property('seconds to the end', took)\n"
    )
    found = run_row(Row("x", "", (str(tmp_path / "test_some.py"),)))
    assert (found.passed, found.failed) == (3, 0)
    shown = line_of(Row("x", "It ends."), found)[1]
    assert shown == "It ends. Median of 3 seconds to the end: 0.50, longest 4.00."


def test_chosen_rows_are_printed_and_leave_the_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("reliability.run_row", lambda _: Result(2, 0, 0.4))
    monkeypatch.setattr("reliability.PAGE", SimpleNamespace())
    assert main(["--rows", "array zoo"]) == 0
    assert capsys.readouterr().out.startswith("array zoo | ")
