"""Each row of the scoreboard names tests that are there, and the page shows every row."""

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from markdown_rows import rows_of
from reliability import line_of, main, publish, run_row
from reliability_kept import FILE, PAGE, Kept, Result, keep, read
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


def test_the_page_shows_what_was_kept(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE.read_text("utf-8"), "utf-8")
    publish(FILE, page)
    assert page.read_text("utf-8") == PAGE.read_text("utf-8")
    shown = [row for row in rows_of(page.read_text("utf-8")) if len(row) == 5]
    assert [row[0] for row in shown[1:]] == [row.name for row in ROWS]


def test_every_kept_result_belongs_to_a_row() -> None:
    assert set(read(FILE)) <= {name for row in ROWS for name in (row.name, *row.long)}


GOOD = Result(2, 0)


def shown(row: Row, **results: Result) -> list[str]:
    """The last four cells of its line; results are those of the row's own tests."""
    tests = {"x": row.tests, **{name: (name,) for name in row.long}}
    every = {
        name: Kept(result, tests[name], "2026-01-02", "abc", "m")
        for name, result in results.items()
    }
    return line_of(row, every)[1:]


def test_a_row_with_a_failed_or_skipped_test_does_not_hold(tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(
        "import pytest\n"
        "def test_good(): pass\n"
        "def test_bad(): assert False\n"
        "def test_skipped(): pytest.skip('no')\n"
        "def test_dies(): import os; os._exit(3)\n"
    )
    place = str(tmp_path / "test_some.py")
    chosen = {name: Row("x", ".", (f"{place}::test_{name}",)) for name in ("good", "dies")}
    some = Row("x", ".", (f"{place}::test_good", f"{place}::test_bad", f"{place}::test_skipped"))
    good, dies, three = (run_row(row) for row in (chosen["good"], chosen["dies"], some))
    assert (good.passed, good.failed) == (1, 0)
    assert (dies.passed, dies.failed) == (0, 1)
    assert (three.passed, three.failed) == (1, 2)
    assert shown(some, x=good) == [".", "yes", "1", "2026-01-02, abc"]
    assert shown(some, x=three)[1:3] == ["**no**", "1, 2 failed"]
    assert shown(some, x=Result(0, 0))[1] == "**no**"


def test_a_filter_that_finds_no_rust_test_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    said = SimpleNamespace(stdout="test result: ok. 0 passed; 0 failed", stderr="", returncode=0)
    monkeypatch.setattr("reliability.subprocess.run", lambda *_, **__: said)
    assert run_row(Row("x", "", (), ("none::",))) == Result(0, 1)
    said.stdout = "test result: ok. 3 passed; 1 failed"
    assert run_row(Row("x", "", (), ("some::",))) == Result(3, 1)


def test_a_row_holds_in_part_where_something_is_not_tested() -> None:
    part = Row("x", ".", ("a",), missing="it")
    assert shown(part, x=GOOD)[:3] == [". Not tested: it.", "in part", "2"]
    assert shown(Row("x", ".", missing="it")) == [". Not tested: it.", "not tested", "", ""]


def test_a_row_whose_tests_have_changed_was_not_run() -> None:
    before, after = Row("x", ".", ("a",), ("b",)), Row("x", ".", ("a", "b"))
    every = {"x": Kept(GOOD, before.tests, "2026-01-02", "abc", "m")}
    assert line_of(before, every)[2] == "yes"
    for changed in (after, Row("x", ".", ("a",)), Row("x", ".", ("a",), ("c",))):
        assert line_of(changed, every)[2:] == ["not run in full", "", ""]
    assert shown(after)[1:] == ["not run in full", "", ""]


def test_a_long_form_is_kept_apart() -> None:
    row = Row("x", ".", ("a",), long=("long", "other"))
    told = Result(1, 0, notes=("It held.",))
    assert shown(row, x=GOOD)[:3] == [". Not tested: `long`. Not tested: `other`.", "in part", "2"]
    assert shown(row, x=GOOD, long=told)[:3] == [". It held. Not tested: `other`.", "in part", "3"]
    assert shown(row, x=GOOD, long=told, other=GOOD)[:3] == [". It held.", "yes", "5"]
    assert shown(row, x=GOOD, long=told, other=Result(0, 1))[1] == "**no**"
    assert shown(row, long=told, other=told)[1] == "not run in full"


def test_what_a_test_measures_is_kept(tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(
        "import pytest\n"
        "@pytest.mark.parametrize('took', [0.5, 0.25, 4.0])\n"
        "def test_good(took, record_property):\n"
        "    record_property('seconds to the end', took)\n"
        "    record_property('statistics', 'a text')\n"
    )
    found = run_row(Row("x", "", (str(tmp_path / "test_some.py"),)))
    assert (found.passed, found.failed) == (3, 0)
    assert found.measured == {"seconds to the end": [0.5, 0.25, 4.0]}
    assert shown(Row("x", ".", ("a",)), x=found)[0] == (
        ". Seconds to the end: median 0.50, longest 4.00."
    )
    keep(tmp_path / "kept.json", "x", Kept(found, ("a",), "2026-01-02", "abc", "m"))
    assert read(tmp_path / "kept.json")["x"].result == found


def test_chosen_rows_are_renewed_and_the_others_stay(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, page = tmp_path / "kept.json", tmp_path / "page.md"
    page.write_text("a\n<!-- scoreboard: begin -->\n<!-- scoreboard: end -->\nz\n")
    monkeypatch.setattr("reliability.run_row", lambda _: GOOD)
    monkeypatch.setattr("reliability.FILE", file)
    monkeypatch.setattr("reliability.PAGE", page)
    assert main(["--rows", "array zoo"]) == 0
    monkeypatch.setattr("reliability.run_row", lambda _: Result(2, 1))
    assert main(["--rows", "thread count", "disk full"]) == 1
    out = capsys.readouterr().out.splitlines()
    assert [line.split(" | ")[0] for line in out] == ["array zoo", "disk full", "thread count"]
    verdicts = {row[0]: row[2] for row in rows_of(page.read_text("utf-8")) if len(row) == 5}
    assert verdicts["array zoo"] == "yes"
    assert verdicts["disk full"] == verdicts["thread count"] == "**no**"
    assert verdicts["panic in one world"] == "not run in full"
    before = page.read_text("utf-8")
    assert main(["--list"]) == 0
    assert page.read_text("utf-8") == before
    assert set(read(file)) == {"array zoo", "disk full", "thread count"}


def test_results_of_several_processes_are_all_kept(tmp_path: Path) -> None:
    file, names = tmp_path / "kept.json", [f"row {index}" for index in range(16)]
    with ThreadPoolExecutor(8) as pool:  # a lock of a file holds between its handles
        list(pool.map(lambda x: keep(file, x, Kept(GOOD, (x,), "d", "c", "m")), names))
    assert set(read(file)) == set(names)
