"""The pages about studies show what their commands make of the runs kept in the documentation."""

import re
import shutil
from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.experiments.archive import FILE, read_archive

DOCS = Path(__file__).parents[1] / "docs"
RECORDS = DOCS / "records"


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text("utf-8")


def command(name: str) -> list[str]:
    """The arguments of the command that made the page."""
    (found,) = re.findall(r"^innerattn (reproduce .*)$", page(name), flags=re.MULTILINE)
    return re.sub(" --out [^ ]*", "", found).split()


def shown(name: str) -> str:
    """The report on the page: the claims, with which it opens, and the rest."""
    parts = (
        page(name).split(f"<!-- {part}: begin -->")[1].split(f"<!-- {part}: end -->")[0].strip()
        for part in ("claims", "report")
    )
    return "\n\n".join(parts)


def made(name: str, report: str, tmp_path: Path, *arguments: str) -> str:
    """What a command makes of the kept runs, a level of headings deeper as on the page."""
    study = tmp_path / "study"
    study.mkdir()
    shutil.copyfile(RECORDS / f"{name}.parquet", study / FILE)
    main([*arguments, "--report-only", "--out", str(study)])
    text = (study / report).read_text("utf-8")
    return re.sub("^#", "##", text, flags=re.MULTILINE).strip()


@pytest.mark.parametrize("path", sorted(RECORDS.glob("*.parquet")), ids=lambda path: path.stem)
def test_the_archived_runs_are_those_on_the_page(path: Path) -> None:
    name = path.stem
    archived = {run.folder.name for run in read_archive(path)}
    assert archived == set(re.findall("`runs/([^`]+)`", shown(name)))


def test_the_page_on_the_crossed_design(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = made("crossed", "crossed.md", tmp_path, *command("crossed"))
    assert capsys.readouterr().err == ""
    assert shown("crossed") == text.replace("(crossed", "(images/reproduction-crossed")


@pytest.mark.parametrize("name", ["paper_protocol", "reproduction"])
def test_pages_on_the_paper(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All but what needs the steps of the runs, which are not kept."""
    target, every, *options = command(name)
    assert every == "all"
    text = made(name, "report.md", tmp_path, target, "table2", *options)
    assert capsys.readouterr().err == ""
    lines = [re.sub(r"( \| –)+ \|$", "", line) for line in text.splitlines()]
    assert sum(line.startswith("| ") for line in lines) > 20
    there = shown(name).splitlines()
    assert [line for line in lines if not any(one.startswith(line) for one in there)] == []
