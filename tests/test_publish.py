"""`docs/publish.py`: places for tables are on the pages, and a study fills those of its target."""

import shutil
import sys
from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.errors import RunError
from innerattn.experiments.archive import FILE, read_archive
from innerattn.report.marks import marked
from innerattn.report.targets import TARGETS

DOCS = Path(__file__).parents[1] / "docs"
sys.path.insert(0, str(DOCS))
import publish  # noqa: E402

ATTENTION = ("attention", "fast")


def test_every_place_is_on_its_page() -> None:
    for page, groups in publish.TABLES.values():
        for part in (part for parts in groups for part in parts):
            marked(page, part)
    for page, _ in publish.PLACES.values():
        for part in ("summary", "details"):
            marked(page, part)


def test_reports_are_those_of_the_targets() -> None:
    for target, _ in (*publish.PLACES, *publish.TABLES):
        load = TARGETS[target].report
        files = ("report.md",) if load is None else load().files
        assert publish.report_name(target) in files


@pytest.fixture
def pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the page on attention, where it is filled."""
    docs = tmp_path / "docs"
    shutil.copytree(DOCS / "records", docs / "records")
    shutil.copy(DOCS / "attention.md", docs)
    page, groups = publish.TABLES[ATTENTION]
    monkeypatch.setattr(publish, "DOCS", docs)
    monkeypatch.setitem(publish.TABLES, ATTENTION, (docs / page.name, groups))
    return docs


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """The study of attention, of the archived runs of two seeds."""
    pool = tmp_path / "pool"
    pool.mkdir()
    shutil.copy(DOCS / "records" / "fast.parquet", pool / FILE)
    words = ["reproduce", ATTENTION[0], "--budget", ATTENTION[1], "--seeds", "2"]
    assert main([*words, "--presets", "mixed", "--report-only", "--out", str(pool)]) == 0
    return pool / ATTENTION[0]


@pytest.mark.long
def test_tables_and_runs_of_a_study_go_to_their_places(pages: Path, study: Path) -> None:
    archive = pages / "records" / "fast.parquet"
    before = {run.folder.name: run.config_sha256 for run in read_archive(archive)}
    publish.publish(study)
    page = pages / "attention.md"
    report = publish.by_heading((study / "report.md").read_text())
    assert marked(page, "attention_fast")[1].strip() == "\n\n".join(
        report[one] for one in ("Contrasts", "Scores")
    )
    strong = marked(page, "attention_strong")[1]
    assert strong == marked(DOCS / "attention.md", "attention_strong")[1]
    assert {run.folder.name: run.config_sha256 for run in read_archive(archive)} == before


def test_a_report_without_its_tables_changes_nothing(pages: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    report.write_text("# What is learnt\n\n## Learning curves\n\nNone.\n")
    before = (pages / "attention.md").read_bytes()
    with pytest.raises(RunError, match="has no section 'Contrasts'"):
        publish.publish_tables(report, *publish.TABLES[ATTENTION])
    assert (pages / "attention.md").read_bytes() == before


def test_a_report_may_lack_all_parts_of_a_group_and_not_some(tmp_path: Path) -> None:
    page, report = tmp_path / "page.md", tmp_path / "report.md"
    empty = "".join(f"<!-- {part}: begin -->\n\n<!-- {part}: end -->\n" for part in "abc")
    groups = ({"a": ("One",), "b": ("Two",)}, {"c": ("Three",)})
    page.write_text(empty)
    report.write_text("# Report\n\n## Three\n\ntext of three\n")
    publish.publish_tables(report, page, groups)
    assert [marked(page, part)[1].strip() for part in "abc"] == ["", "", "text of three"]
    page.write_text(empty)
    report.write_text("# Report\n\n## Two\n\ntwo\n\n## Three\n\nthree\n")
    with pytest.raises(RunError, match="has no section 'One'"):
        publish.publish_tables(report, page, groups)
    assert page.read_text() == empty


def test_what_has_no_place_or_no_report_is_refused(study: Path) -> None:
    (study / "report.md").unlink()
    with pytest.raises(RunError, match=r"report\.md: missing; `innerattn reproduce attention`"):
        publish.publish(study)
    other = study.rename(study.with_name("crossed"))
    with pytest.raises(RunError, match="there is no place for crossed of fast, only for all of"):
        publish.publish(other)
    with pytest.raises(RunError, match="holds no study"):
        publish.publish(study)
