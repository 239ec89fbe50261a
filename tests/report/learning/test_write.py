"""The files on learning: the same twice, what the tables say, and when there is no figure."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from markdown_rows import rows_of

from innerattn.experiments.run import FinishedRun
from innerattn.report.learning.page import ATTENTION, CURVES, SCORES
from innerattn.report.learning.write import learning_files, write_learning

FILES = learning_files("learning")


def test_files_are_the_same_twice(runs: list[FinishedRun], tmp_path: Path) -> None:
    first, second = ({}, {})
    for files in (first, second):
        write_learning(runs, tmp_path, "short", [], name="learning")
        files.update({path.name: path.read_bytes() for path in tmp_path.iterdir()})
    assert first == second
    assert set(first) == set(FILES)


def test_the_page_shows_every_run(runs: list[FinishedRun], tmp_path: Path) -> None:
    found = write_learning(runs, tmp_path, "short", ["mixed td-inner seed 9: failed"], name="x")
    text = (tmp_path / "x.md").read_text()
    assert text.index("- mixed td-inner seed 9: failed") < text.index(f"## {SCORES}")
    assert "6 runs, budget `short`." in text
    rows = {row[0]: row[1:] for row in rows_of(text)}
    head = ["rescues, 25 steps", "score, 25 steps", "score, 30 steps"]
    assert rows["short, seeds 0 to 2"] == head
    own = sorted((run for run in runs if run.method == "td-inner"), key=lambda run: run.seed)
    rescues = [run.summary["rescues_per_episode"]["mean"] for run in own]
    cell = rows["td-inner, mixed"][0]
    assert cell.startswith(f"**{sum(rescues) / 3:.2f}** ± ")
    assert cell.endswith(f" ({', '.join(f'{value:.2f}' for value in rescues)})")
    single = next(run for run in runs if run.situation == "single")
    value = single.summary["score"]["mean"]
    assert rows["ppo-inner, single"][1] == f"**{value:.2f}** ({value:.2f})"
    assert f"## {ATTENTION}" not in text  # two seeds of td-uniform are too few
    assert "(x.png)" in text
    document = json.loads((tmp_path / "x.json").read_text())
    assert [len(one["seeds"]) for one in document["learnt"]] == [len(x.seeds) for x in found.learnt]
    assert len(document["runs"]) == 6
    assert {run["weights_sha256"] for run in document["runs"]} == {r.weights_sha256 for r in runs}


def test_archived_runs_have_no_learning_curves(runs: list[FinishedRun], tmp_path: Path) -> None:
    write_learning(runs, tmp_path, "short", [], name="learning")
    archived = [replace(run, archived=True) for run in runs]
    write_learning(archived, tmp_path, "short", [], name="learning")
    assert {path.name for path in tmp_path.iterdir()} == {"learning.json", "learning.md"}
    text = (tmp_path / "learning.md").read_text()
    assert f"## {CURVES}" not in text
    assert ".png" not in text


@pytest.mark.parametrize(("budget", "noted"), [("quick", True), ("short", False)])
def test_a_smoke_run_says_so(
    budget: str, noted: bool, runs: list[FinishedRun], tmp_path: Path
) -> None:
    write_learning(runs[:1], tmp_path, budget, [], name="learning")
    assert ("smoke run" in (tmp_path / "learning.md").read_text()) == noted
    assert bool(json.loads((tmp_path / "learning.json").read_text())["note"]) == noted
