"""The whole report on made runs: its files, the same bytes twice, and what it says."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from innerattn.config import read_toml
from innerattn.errors import RunError
from innerattn.experiments.run import FinishedRun, read_run, refuse_unlike
from innerattn.experiments.smoke import smoke_note
from innerattn.report.paper.write import write_report
from innerattn.train.weights import digest_of

FIGURES = ("fig4", "fig5", "fig5_evidence")
FILES = {
    *(f"{name}.{kind}" for name in FIGURES for kind in ("json", "pdf", "png")),
    *("table2.json", "table2.md", "table2.csv", "fig4.csv", "report.md"),
}


@pytest.fixture(scope="module")
def folder(runs: list[FinishedRun], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "report"
    write_report(runs, path, "quick")
    return path


def test_all_files_are_written_and_the_same_twice(
    runs: list[FinishedRun], folder: Path, tmp_path: Path
) -> None:
    assert {path.name for path in folder.iterdir()} == FILES
    write_report(runs, tmp_path, "quick")
    for name in FILES:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name
    title = json.loads((folder / "fig5.json").read_text())["title"]
    assert title.startswith("mixed, td-inner, seed 0")  # the first of those that are preferred
    for path in folder.glob("*.json"):
        version = 3 if path.name == "fig5_evidence.json" else 1
        assert json.loads(path.read_text())["schema_version"] == version


def test_the_report_opens_with_claims_and_ends_with_the_runs(
    runs: list[FinishedRun], folder: Path
) -> None:
    text = (folder / "report.md").read_text()
    assert text.index("| claim |") < text.index("## Table II") < text.index("## Fig. 4")
    mixed, others = text.split("## The same in the other situations")
    assert "| even sharing with inner attention | mixed | td-inner |" in mixed
    assert "| even sharing with inner attention | single | ppo-inner | – |" in others  # not printed
    for run in runs:
        assert f"`{run.folder}`" in text
        assert f"`{read_toml(run.folder / 'config.toml').digest()}`" in text
        assert f"`{digest_of(run.folder / 'checkpoints/0/weights.safetensors')}`" in text
    for name in FIGURES:
        assert f"({name}.png)" in text
    assert (folder / "table2.md").read_text().split("\n\n", 1)[1] in text  # but for the note


def test_every_file_of_a_smoke_run_says_so(
    runs: list[FinishedRun], folder: Path, tmp_path: Path
) -> None:
    write_report(runs, tmp_path, "short")
    note = smoke_note("quick") or ""
    for name in FILES:
        smoke, other = (of / name for of in (folder, tmp_path))
        if smoke.suffix in (".pdf", ".png"):
            assert smoke.read_bytes() != other.read_bytes()
            continue
        assert note[1:] in smoke.read_text(), name
        assert "smoke" not in other.read_text(), name
    assert {row[-1] for row in _rows(folder / "table2.csv")[1:]} == {note}
    for name in ("table2.csv", "fig4.csv"):
        assert [row[:-1] for row in _rows(folder / name)] == _rows(tmp_path / name)


def _rows(path: Path) -> list[list[str]]:
    return list(csv.reader(path.read_text().splitlines()))


def test_runs_within_the_study_are_named_from_there(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    run = runs[0]
    inside = tmp_path / "runs" / "one"
    shutil.copytree(run.folder, inside)
    findings = write_report([replace(run, folder=inside)], tmp_path, "short", ("table2",))
    assert findings.folder == tmp_path
    text = (tmp_path / "report.md").read_text()
    assert "| `runs/one` |" in text
    assert str(tmp_path) not in text


def test_parts_can_be_asked_for_alone(runs: list[FinishedRun], tmp_path: Path) -> None:
    findings = write_report(runs[3:5], tmp_path, "short", ("table2", "fig4"))
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        "report.md",
        "fig4.json",
        "fig4.csv",
        *(f"table2.{x}" for x in ("json", "md", "csv")),
    }
    text = (tmp_path / "report.md").read_text()
    assert "smoke run" not in text
    assert "Fig. 5:" not in text
    write_report(runs[3:5], tmp_path, "short", ("fig4",))  # attention that is even
    assert "There is no mixed run" not in (tmp_path / "report.md").read_text()
    write_report(runs[5:], tmp_path, "short", ("fig4",))
    assert "There is no mixed run" in (tmp_path / "report.md").read_text()
    assert findings.evidence is None
    with pytest.raises(ValueError, match=r"parts = \['fig6'\]: known are table2, fig4, fig5"):
        write_report(runs, tmp_path, "short", ("fig6",))


def test_a_figure_that_is_not_drawn_leaves_none_of_other_runs(
    runs: list[FinishedRun], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("innerattn.report.paper.write.choose_scene", lambda _: None)
    shutil.copytree(folder, tmp_path / "study")
    write_report(runs[3:5], tmp_path / "study", "short")  # attention that is even
    gone = {f"{name}.{kind}" for name in FIGURES for kind in ("pdf", "png")} | {"fig5.json"}
    assert {path.name for path in (tmp_path / "study").iterdir()} == FILES - gone


def test_it_is_said_where_all_seeds_were_measured_in_the_same_worlds(
    runs: list[FinishedRun], folder: Path, tmp_path: Path
) -> None:
    said = "**Runs of different seeds were measured in the same worlds.**"
    assert said not in (folder / "report.md").read_text()
    evaluate = runs[0].config.evaluate.model_copy(update={"seed": 7})
    moved = [
        replace(run, config=run.config.model_copy(update={"evaluate": evaluate}))
        for run in runs[:2]  # of different seeds
    ]
    write_report(moved, tmp_path / "report", "short", ("table2",))
    assert said in (tmp_path / "report" / "report.md").read_text()
    (other,) = [run for run in runs if (run.method, run.seed) == ("td-uniform", moved[1].seed)]
    with pytest.raises(RunError, match=r"of one seed, and evaluate\.seed is .*: must be the same"):
        refuse_unlike([moved[1], other])


def test_both_attentions_are_compared_where_both_are_there(folder: Path) -> None:
    text = (folder / "report.md").read_text()
    compared = text.split("## Learnt attention beside uniform weights")[1].split("## Is evenness")[
        0
    ]
    assert compared.count("| mixed | td | score | 0, 1 |") == 1
    assert "| single |" not in compared  # has learnt attention only


def test_runs_with_and_without_a_warm_start_are_not_one_method(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    warm = tmp_path / "warm"
    shutil.copytree(runs[0].folder, warm)
    config = warm / "config.toml"
    text = config.read_text()
    assert 'warm_start = "none"' in text
    config.write_text(text.replace('warm_start = "none"', 'warm_start = "greedy"'))
    started = read_run(runs[0].case, warm)
    for pair in ([started, runs[1]], [runs[1], started]):
        with pytest.raises(RunError, match=r"listed as the same but for the seed.*train"):
            refuse_unlike(pair)


def test_nothing_is_written_where_a_run_is_missing(runs: list[FinishedRun], tmp_path: Path) -> None:
    with pytest.raises(RunError, match="seed 0; must be one run of each seed"):
        write_report([runs[1], runs[1]], tmp_path / "none", "short")
    assert not (tmp_path / "none").exists()
