"""`docs/publish.py`: places for tables are on the pages, and a study fills those of its target."""

import json
import shutil
import sys
from pathlib import Path

import pytest

from innerattn.errors import RunError
from innerattn.experiments.archive import read_archive
from innerattn.experiments.run import FinishedRun
from innerattn.report.learning.write import write_learning
from innerattn.report.marks import marked
from innerattn.report.targets import TARGETS

DOCS = Path(__file__).parents[1] / "docs"
sys.path.insert(0, str(DOCS))
import publish  # noqa: E402

LEARNING = ("learning", "short")


def test_every_place_is_on_its_page() -> None:
    for page, groups in publish.TABLES.values():
        for part in (part for parts in groups for part in parts):
            marked(page, part)
    for page, _ in publish.PLACES.values():
        for part in ("summary", "details"):
            marked(page, part)


def test_reports_are_those_of_the_targets() -> None:
    for target, _ in (*publish.PLACES, *publish.TABLES):
        assert publish.report_name(target) in TARGETS[target].report().files


@pytest.fixture
def pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the page on learning, where it is filled, and of its figure."""
    docs = tmp_path / "docs"
    (docs / "images").mkdir(parents=True)
    shutil.copy(DOCS / "learning.md", docs)
    (docs / "images" / "learning_short.png").touch()
    page, groups = publish.TABLES[LEARNING]
    monkeypatch.setattr(publish, "DOCS", docs)
    monkeypatch.setitem(publish.TABLES, LEARNING, (docs / page.name, groups))
    return docs


def publish_study(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["publish.py", str(study)])
    publish.main()


def test_tables_and_figure_of_a_study_go_to_their_places(
    pages: Path, runs: list[FinishedRun], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = tmp_path / "study"
    study.mkdir()
    write_learning(runs, study, "short", [], name="learning")
    account = {"target": "learning", "budget": "short", "outputs": ["learning.md"]}
    (study / "runs.json").write_text(json.dumps(account))
    publish_study(study, monkeypatch)
    page = pages / "learning.md"
    tables = (study / "learning.md").read_text().split("## Scores\n")[1].split("\n## ")[0]
    assert marked(page, "learning_short")[1].strip() == tables.strip()
    for part in ("learning_quick", "learning_short_entities", "warm_start_quick"):
        assert marked(page, part)[1] == marked(DOCS / "learning.md", part)[1]
    figure = pages / "images" / "learning_short.png"
    assert figure.read_bytes() == (study / "learning.png").read_bytes()


def test_an_archive_of_several_targets_keeps_the_runs_of_others(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    study, path = runs[0].folder.parent, tmp_path / "records" / "fast.parquet"
    rows = [
        {
            "state": "finished",
            "folder": run.folder.name,
            "situation": run.situation,
            "method": run.method,
            "seed": run.seed,
            "variant": "",
        }
        for run in runs
    ]
    rows.append({**rows[0], "state": "failed"})
    first, second, both = rows[:3], rows[2:], tmp_path / "both.parquet"
    publish._add(first, study, path)
    assert [run.folder.name for run in read_archive(path)] == sorted(r["folder"] for r in first)
    publish._add(second, study, path)
    publish._add(rows, study, both)
    assert path.read_bytes() == both.read_bytes()
    assert len(read_archive(path)) == len(runs)


def test_a_report_without_its_tables_changes_nothing(pages: Path, tmp_path: Path) -> None:
    report = tmp_path / "learning.md"
    report.write_text("# What is learnt\n\n## Learning curves\n\nNone.\n")
    before = (pages / "learning.md").read_bytes()
    with pytest.raises(RunError, match="has no section 'Scores'"):
        publish.publish_tables(report, *publish.TABLES[LEARNING])
    assert (pages / "learning.md").read_bytes() == before


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


@pytest.mark.parametrize(
    ("account", "message"),
    [
        (None, "no study; `innerattn reproduce` makes one"),
        ({"target": "fig4", "budget": "short", "outputs": ["report.md"]}, "last made fig4 of"),
        (
            {"target": "learning", "budget": "paper", "outputs": ["learning.md"]},
            "of budget 'paper'",
        ),
        ({"target": "learning", "budget": "short", "outputs": []}, "was interrupted"),
    ],
)
def test_what_has_no_place_is_refused(
    account: dict[str, object] | None,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if account is not None:
        (tmp_path / "runs.json").write_text(json.dumps(account))
    with pytest.raises(SystemExit) as ended:
        publish_study(tmp_path, monkeypatch)
    assert message in str(ended.value)
