"""Reports as parts of pages: what the files of studies ask for, and what is refused."""

import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from innerattn.cli.main import main
from innerattn.errors import ConfigError, RunError
from innerattn.experiments.archive import FILE, read_archive
from innerattn.report.marks import marked
from innerattn.report.study.publish import publish
from innerattn.report.targets import TARGETS
from innerattn.studies.folder import StudyFolder, begin_study_in, open_study
from innerattn.studies.results import read_results
from innerattn.studies.shipped import shipped_table
from innerattn.studies.study import Study, study_in

DOCS = Path(__file__).parents[2] / "docs"
REPORT = """\
> **A note.**

# What is it?

It is so. ![Scores](scores.png)

## Contrasts

none

## Scores

| a | b |

[all](runs.csv), [far](https://example.org/x.png), [above](../up.md)
"""
PAGE = "# Mine\n\n<!-- answer: begin -->\nold\n<!-- answer: end -->\n\nWords of mine.\n"


@pytest.mark.parametrize("name", dict.fromkeys(one.file or one.name for one in TARGETS.values()))
def test_every_part_of_a_shipped_study_is_on_its_page(name: str) -> None:
    asked = study_in(tomli_w.dumps(shipped_table(name)).encode(), f"{name}.toml").report
    assert asked is not None
    for one in asked.pages:
        marked(DOCS / one.page, one.part)
        if one.figure is not None:
            assert f"(images/{one.part}.png)" in (DOCS / one.page).read_text("utf-8")


def begun(folder: Path, *pages: Mapping[str, Any], name: str = "mine") -> StudyFolder:
    """A study without a run whose report goes to pages, and its report."""
    pages = tuple({"page": "page.md", "part": "answer", **one} for one in pages)
    table = {"grid": {"budgets": ["fast"]}, "report": {"pages": pages}}
    study = begin_study_in(tomli_w.dumps(table).encode(), Path("mine.toml"), folder / name)
    (study.path / "report.md").write_text(REPORT)
    for file in ("scores.png", "scores.pdf", "runs.csv"):
        (study.path / file).write_text(file)
    return study


@pytest.fixture
def docs(tmp_path: Path) -> Path:
    docs = tmp_path / "docs"
    docs.mkdir()
    (docs / "page.md").write_text(PAGE)
    return docs


def filled(docs: Path, study: StudyFolder) -> str:
    page = docs / "page.md"
    assert publish(study, study.path / "report.md", [], docs) == [page]
    before, part, after = marked(page, "answer")
    assert before + "old\n" + after == PAGE
    return part.strip()


def test_a_page_takes_the_opening_or_sections_in_its_order(tmp_path: Path, docs: Path) -> None:
    opening = begun(tmp_path, {"sections": ["opening"]})
    assert filled(docs, opening) == "> **A note.**\n\n\nIt is so. ![Scores](images/page-scores.png)"
    assert (docs / "images" / "page-scores.png").read_text() == "scores.png"
    assert (docs / "images" / "page-scores.pdf").read_text() == "scores.pdf"
    both = begun(tmp_path, {"sections": ["Scores", "Contrasts", "Curves"]}, name="both")
    shutil.copy(docs / "page.md", tmp_path)
    (docs / "page.md").write_text(PAGE)
    text = filled(docs, both)
    assert text.startswith("| a | b |")
    assert text.endswith("\n\nnone")
    assert (
        "[all](tables/page/runs.csv), [far](https://example.org/x.png), [above](../up.md)" in text
    )
    assert (docs / "tables" / "page" / "runs.csv").read_text() == "runs.csv"


def test_a_page_takes_all_sections_with_their_headings(tmp_path: Path, docs: Path) -> None:
    text = filled(docs, begun(tmp_path, {"figure": "scores.png", "images": "img/"}))
    assert re.findall("^## (.*)$", text, flags=re.M) == ["Contrasts", "Scores"]
    assert "It is so" not in text
    assert (docs / "images" / "answer.png").read_text() == "scores.png"


@pytest.mark.parametrize(
    ("pages", "said"),
    [
        ([], r"mine: \[\[report.pages\]\] of its file names no page"),
        ([{"budget": "strong"}], "names no page for fast"),
        ([{"page": "other.md"}], r"other\.md: missing; --publish names the folder"),
        ([{"part": "other"}], r"page\.md: no marks <!-- other: begin -->"),
        ([{}, {"sections": ["Curves"]}], r"report\.md: has no section 'Curves'; runs are missing"),
        ([{"sections": ["Curves"], "required": False}], "has none of the sections"),
        (
            [{"archive": "no.parquet"}, {"figure": "none.png"}],
            r"none\.png: missing; write the report again",
        ),
    ],
)
def test_what_is_missing_is_said_and_nothing_changes(
    pages: list[dict[str, Any]], said: str, tmp_path: Path, docs: Path
) -> None:
    study = begun(tmp_path, *pages)
    with pytest.raises(RunError, match=said):
        publish(study, study.path / "report.md", [], docs)
    assert [path.name for path in docs.iterdir()] == ["page.md"]
    assert (docs / "page.md").read_text() == PAGE


def test_a_report_that_is_not_there_is_said(tmp_path: Path, docs: Path) -> None:
    study = begun(tmp_path, {})
    (study.path / "report.md").unlink()
    with pytest.raises(RunError, match=r"report\.md: missing; write the report first"):
        publish(study, study.path / "report.md", [], docs)


@pytest.mark.parametrize(
    ("report", "said"),
    [
        (
            'sections = ["Score"]',
            "report.sections: 'Score': must be of 'Contrasts', 'Scores'.*'Sco",
        ),
        ('sections = ["Rules", "Rules"]', "report.sections: 'Rules' stands twice"),
        ('[[report.pages]]\npage = "/a.md"\npart = "x"', r"report.pages\[0\].page = '/a.md'"),
        ('[[report.pages]]\npage = "../a.md"\npart = "x"', "must not lead out"),
        ('[[report.pages]]\npage = "a.md"\npart = "x -->"', r"report.pages\[0\].part"),
        ('[[report.pages]]\npage = "a.md"', "part"),
    ],
)
def test_what_no_report_can_show_is_refused(report: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        study_in(f"[report]\n{report}\n".encode(), "mine.toml")


def test_titles_are_not_those_of_other_sections() -> None:
    with pytest.raises(ConfigError, match="tables and curves: the name 'Rules' stands twice"):
        study_in(b'[[curves]]\ntitle = "Rules"\n', "mine.toml")


def test_what_is_shown_is_a_rule_and_where_is_none() -> None:
    plain = Study()
    pages = {"pages": [{"page": "a.md", "part": "x"}]}
    assert Study.model_validate({"report": pages}).digest() == plain.digest()
    shown = Study.model_validate({"report": {"sections": ["Scores"]}})
    assert shown.digest() != plain.digest()
    assert Study.model_validate({"report": {"sections": ["Scores"], **pages}}) != shown
    both = Study.model_validate({"report": {"sections": ["Scores"], **pages}})
    assert both.digest() == shown.digest()


@pytest.mark.long
def test_the_command_shows_chosen_sections_and_keeps_an_archive(
    tmp_path: Path, docs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pool = tmp_path / "pool"
    pool.mkdir()
    shutil.copy(DOCS / "records" / "fast.parquet", pool / FILE)
    table = {
        "grid": {"methods": ["ppo-inner", "ppo-uniform"], "budgets": ["fast"], "seeds": [0, 1]},
        "contrasts": [
            {
                "name": "attention",
                "a": {"method": "ppo-inner"},
                "b": {"method": "ppo-uniform"},
                "margin": 0.05,
            }
        ],
        "report": {
            "sections": ["Contrasts", "Scores"],
            "pages": [{"page": "page.md", "part": "answer", "archive": "data/runs.parquet"}],
        },
    }
    begin_study_in(tomli_w.dumps(table).encode(), Path("mine.toml"), tmp_path / "mine", pool=pool)
    words = ["study", "report", str(tmp_path / "mine"), "--publish", str(docs)]
    assert main(words) == 0
    archive = docs / "data" / "runs.parquet"
    assert f"Filled: {docs / 'page.md'}, {archive}" in capsys.readouterr().out
    report = (tmp_path / "mine" / "report.md").read_text()
    assert re.findall("^## (.*)$", report, flags=re.M) == ["Contrasts", "Scores"]
    assert marked(docs / "page.md", "answer")[1].strip() == report[report.index("## ") :].strip()
    runs = read_results(open_study(tmp_path / "mine")).runs
    assert len(runs) == 4
    assert {one.folder.name: one.config_sha256 for one in read_archive(archive)} == {
        one.folder.name: one.config_sha256 for one in runs
    }


def test_a_page_that_is_missing_is_said_before_the_training(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A run would take minutes, and is not begun."""
    words = ["--budget", "fast", "--presets", "mixed", "--seeds", "1", "--out", str(tmp_path)]
    assert main(["reproduce", "attention", *words, "--publish", str(tmp_path / "none")]) == 1
    assert "none/attention.md: missing; --publish names the folder" in capsys.readouterr().err
    file = tmp_path / "mine.toml"
    file.write_text('[[report.pages]]\npage = "mine.md"\npart = "answer"\n')
    words = ["--out", str(tmp_path / "mine"), "--publish", str(tmp_path)]
    assert main(["study", "run", str(file), *words]) == 1
    assert "mine.md: missing; --publish names the folder" in capsys.readouterr().err
    assert not list(tmp_path.rglob("metrics.jsonl"))


def test_pages_show_all_of_the_paper(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["reproduce", "fig4", "--report-only", "--publish", str(tmp_path)]) == 2
    assert "--publish: pages show all of the paper, not fig4: use all" in capsys.readouterr().err
