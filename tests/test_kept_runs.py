"""The runs kept in the documentation are those that its pages show, and show what they say."""

import re
import shutil
from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.config import read_toml
from innerattn.evaluate.sharing.evenness import counts_by_episode
from innerattn.study.claims import RULES
from innerattn.study.crossed.outcome import outcome_of
from innerattn.study.run import Measured, StudyRun, digests, read_measured
from innerattn.study.scores import read_scores
from innerattn.study.table2 import table2
from innerattn.study.table2_text import table2_markdown

DOCS = Path(__file__).parents[1] / "docs"
KEPT = sorted((DOCS / "records").glob("*/runs/*"))


def measured(folder: Path) -> Measured:
    config = read_toml(folder / "config.toml")
    train = config.train
    run = StudyRun(config.scenario.situation, train.method, train.seed, folder)
    assert read_scores(folder, config)
    return read_measured(run, step_by_step=False)


def page(folder: Path) -> list[list[str]]:
    """Cells of every table of the page that a run was kept for."""
    text = (DOCS / f"{folder.parents[1].name}.md").read_text("utf-8")
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line[:2] == "| "]


def row(folder: Path) -> list[str]:
    """Cells of the row that names the run."""
    (found,) = [cells for cells in page(folder) if f"`runs/{folder.name}`" in cells]
    return found


def of_page(name: str) -> list[Path]:
    found = [folder for folder in KEPT if folder.parents[1].name == name]
    assert found
    return found


@pytest.mark.parametrize("folder", KEPT, ids=lambda folder: folder.name)
def test_the_page_names_the_run(folder: Path) -> None:
    named = digests(folder)
    assert row(folder)[-2:] == [f"`{named.config}`", f"`{named.weights}`"]


@pytest.mark.parametrize("folder", of_page("crossed"), ids=lambda folder: folder.name)
def test_figures_of_the_crossed_design(folder: Path) -> None:
    found = outcome_of(measured(folder))
    shown = [float(cell) for cell in row(folder)[3:6]]
    assert shown == pytest.approx([found.unevenness, found.least_share, found.score], abs=0.0051)


@pytest.mark.parametrize("folder", of_page("paper_protocol"), ids=lambda folder: folder.name)
def test_counts_of_the_paper_protocol(folder: Path) -> None:
    found = measured(folder)
    for task in found.scored[0].scenario.tasks:
        first, second = sum(counts_by_episode(part)[task.name].sum(0) for part in found.scored)
        cells = [found.run.method, task.name, str(found.run.seed), f"{first} + {second}"]
        assert cells in [line[:4] for line in page(folder)]


def test_the_paper_protocol_is_judged_by_the_rules_of_today() -> None:
    assert RULES in (DOCS / "paper_protocol.md").read_text("utf-8")


def test_table_2_of_the_paper_protocol() -> None:
    found = sorted(map(measured, of_page("paper_protocol")), key=lambda one: one.run.seed)
    methods = ("td-inner", "td-uniform")
    groups = [[one for one in found if one.run.method == method] for method in methods]
    text = table2_markdown(table2(groups))
    sharing = [
        cells.strip("| ").split(" | ") for cells in text.split("### Competence")[0].splitlines()
    ]
    rows = [cells for cells in sharing if cells[0] in methods]
    assert len(rows) == 2 * 2 * (1 + 1 + 3)  # over all and over 80 episodes, and every run
    shown = page(of_page("paper_protocol")[0])
    assert [cells for cells in rows if cells not in shown] == []


def test_the_crossed_page_is_what_its_command_makes_of_the_records(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(DOCS / "records" / "crossed", tmp_path / "study")
    text = (DOCS / "crossed.md").read_text("utf-8")
    (options,) = re.findall(r"^innerattn (reproduce crossed .*)$", text, flags=re.MULTILINE)
    main([*options.split(), "--out", str(tmp_path / "study")])
    assert capsys.readouterr().err == ""
    made = (tmp_path / "study" / "crossed.md").read_text("utf-8")
    made = made.replace("(crossed.png)", "(images/reproduction-crossed.png)")
    shown = text.split("<!-- report: begin -->")[1].split("<!-- report: end -->")[0]
    assert shown.strip() == re.sub("^#", "##", made, flags=re.MULTILINE).strip()
