"""The whole report on made runs: its files, the same bytes twice, and what it says."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from markdown_rows import rows_of
from reseal import reseal

from innerattn.config import read_toml
from innerattn.errors import RunError
from innerattn.experiments.paper.claims import CLAIMS
from innerattn.experiments.run import FinishedRun, read_run, refuse_unlike
from innerattn.experiments.smoke import smoke_note
from innerattn.report.paper.write import FILES, REPORT, write_report
from innerattn.stats.text import NONE, format_estimate
from innerattn.train.weights import digest_of

FIGURES = ("fig4", "fig5", "fig5_evidence")
ALL = {*REPORT, *(name for of_part in FILES.values() for name in of_part)}


@pytest.fixture(scope="module")
def folder(runs: list[FinishedRun], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "report"
    write_report(runs, path, "quick")
    return path


@pytest.mark.long
def test_all_files_are_written_and_the_same_twice(
    runs: list[FinishedRun], folder: Path, tmp_path: Path
) -> None:
    assert {path.name for path in folder.iterdir()} == ALL
    write_report(runs, tmp_path, "quick")
    for name in ALL:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name
    title = json.loads((folder / "fig5.json").read_text())["title"]
    assert title.startswith("mixed, td-inner, seed 0")  # the first of those that are preferred
    for path in folder.glob("*.json"):
        version = 3 if path.name == "fig5_evidence.json" else 1
        assert json.loads(path.read_text())["schema_version"] == version


@pytest.mark.long
def test_the_report_opens_with_one_row_for_each_claim(folder: Path) -> None:
    text = (folder / "report.md").read_text()
    opening = text.split("\n## ")[0]
    rows = rows_of(opening)
    assert rows[0][:3] == ["claim", "paper", "measured, mixed"]
    assert [row[0] for row in rows[1:]] == list(CLAIMS)
    assert rows[0][3:] == ["holds in mixed?", "holds in single?"]
    assert "6 runs, budget `quick`, seeds 0 to 2." in opening
    assert len(text.split()) < 2_500


@pytest.mark.long
def test_archived_runs_count_for_the_table_and_not_for_the_figures(
    runs: list[FinishedRun], folder: Path, tmp_path: Path
) -> None:
    archived = [replace(run, archived=run.method == "td-uniform" or run.seed == 2) for run in runs]
    (tmp_path / "some").mkdir()
    write_report(archived, tmp_path / "some", "quick")
    write_report([run for run in archived if not run.archived], tmp_path / "full", "quick")
    for name in FILES["table2"]:
        assert (tmp_path / "some" / name).read_bytes() == (folder / name).read_bytes()
    for name in ("fig4.csv", "fig5.json", "fig5_evidence.json"):
        made = (tmp_path / "some" / name).read_bytes()
        assert made == (tmp_path / "full" / name).read_bytes(), name
    assert (tmp_path / "some" / "fig4.csv").read_bytes() != (folder / "fig4.csv").read_bytes()
    text = (tmp_path / "some" / "report.md").read_text()
    full = [run for run in archived if not run.archived]
    methods = ", ".join(sorted({run.method for run in full}, reverse=True))
    seeds = ", ".join(map(str, sorted({run.seed for run in full})))
    assert text.count(f"Made of {len(full)} runs, {methods} with seeds {seeds}: the others") == 2
    assert "Made of" not in (folder / "report.md").read_text()


def test_without_metrics_there_is_no_figure(runs: list[FinishedRun], tmp_path: Path) -> None:
    findings = write_report([replace(run, archived=True) for run in runs], tmp_path, "quick")
    assert (findings.courses, findings.evidence, findings.scene) == ((), (), None)
    assert not list(tmp_path.glob("*.png"))
    assert "No run has attention that chooses" in (tmp_path / "report.md").read_text()


@pytest.mark.long
def test_all_else_is_linked(runs: list[FinishedRun], folder: Path) -> None:
    text = (folder / "report.md").read_text()
    linked = {name for name in ALL if f"({name})" in text}
    drawn = {f"{name}.png" for name in FIGURES}
    assert linked == drawn | {
        "claims.md",
        "table2.md",
        "table2.csv",
        "fig5_evidence.md",
        "runs.csv",
    }
    lines = {row["folder"]: row for row in _table(folder / "runs.csv")}
    for run in runs:
        row = lines[str(run.folder)]
        assert (row["method"], row["seed"]) == (run.method, str(run.seed))
        assert row["config_sha256"] == read_toml(run.folder / "config.toml").digest()
        weights = run.folder / "checkpoints/0/weights.safetensors"
        assert row["weights_sha256"] == digest_of(weights)


@pytest.mark.long
def test_every_claim_is_there_in_full(runs: list[FinishedRun], tmp_path: Path) -> None:
    findings = write_report(runs, tmp_path, "short")
    rows = rows_of((tmp_path / "claims.md").read_text())[1:]
    mixed, single = rows.index(["**mixed**", *[""] * 5]), rows.index(["**single**", *[""] * 5])
    assert mixed < single
    for claim in findings.claims:
        row = [claim.claim, claim.method, claim.printed, claim.measured, str(claim.runs)]
        place = rows.index([*row, f"**{claim.holds}**"])
        assert (place > single) == (claim.situation == "single")
        assert claim.situation == "mixed" or claim.printed == NONE
    assert len(rows) == len(findings.claims) + 2


@pytest.mark.long
def test_every_run_has_its_handoffs(runs: list[FinishedRun], tmp_path: Path) -> None:
    findings = write_report(runs, tmp_path, "short")
    assert findings.evidence is not None
    rows = rows_of((tmp_path / "fig5_evidence.md").read_text())[1:]
    part = findings.evidence[0]
    own = [row for row in rows if row[:2] == [part.situation, part.method]]
    assert [row[2] for row in own] == [*map(str, part.seeds)]
    for row, used, left in zip(own, part.handoffs, part.left_out, strict=True):
        assert row[3] == f"{used} of {used + left}"
    (mean,) = [row for row in rows if row[2] == "mean [95 %]"]
    assert mean[0] == f"**{part.situation}**"
    assert mean[5] == format_estimate(part.robot["to_be"].change)
    assert mean[8] == format_estimate(part.ceiling)


@pytest.mark.long
def test_every_file_of_a_smoke_run_says_so(
    runs: list[FinishedRun], folder: Path, tmp_path: Path
) -> None:
    write_report(runs, tmp_path, "short")
    note = smoke_note("quick") or ""
    for name in ALL:
        smoke, other = (of / name for of in (folder, tmp_path))
        if smoke.suffix in (".pdf", ".png"):
            assert smoke.read_bytes() != other.read_bytes()
            continue
        assert note[1:] in smoke.read_text(), name
        assert "smoke" not in other.read_text(), name
    assert {row[-1] for row in _rows(folder / "table2.csv")[1:]} == {note}
    for name in ("table2.csv", "fig4.csv"):
        assert [row[:-1] for row in _rows(folder / name)] == _rows(tmp_path / name)


def _table(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def _rows(path: Path) -> list[list[str]]:
    return list(csv.reader(path.read_text().splitlines()))


def test_runs_within_the_study_are_named_from_there(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    run = runs[0]
    inside = tmp_path / "runs" / "one"
    shutil.copytree(run.folder, inside)
    write_report([replace(run, folder=inside)], tmp_path, "short", parts=("table2",))
    assert [row["folder"] for row in _table(tmp_path / "runs.csv")] == ["runs/one"]
    assert str(tmp_path) not in (tmp_path / "runs.csv").read_text()


def test_parts_can_be_asked_for_alone(runs: list[FinishedRun], tmp_path: Path) -> None:
    findings = write_report(runs[3:5], tmp_path, "short", parts=("table2", "fig4"))
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {*REPORT, *FILES["table2"], "fig4.json", "fig4.csv"}
    text = (tmp_path / "report.md").read_text()
    assert "smoke run" not in text
    assert "Fig. 5:" not in text
    write_report(runs[3:5], tmp_path, "short", parts=("fig4",))  # attention that is even
    nothing = "What was asked for decides no claim."
    assert all(nothing in (tmp_path / name).read_text() for name in ("report.md", "claims.md"))
    assert "No run has attention that chooses." in (tmp_path / "report.md").read_text()
    write_report(runs[5:], tmp_path, "short", parts=("fig4",))
    assert "| claim | paper | measured, single |" in (tmp_path / "report.md").read_text()
    assert findings.evidence is None
    with pytest.raises(ValueError, match=r"parts = \['fig6'\]: known are table2, fig4, fig5"):
        write_report(runs, tmp_path, "short", parts=("fig6",))


def test_a_figure_that_is_not_drawn_leaves_none_of_other_runs(
    runs: list[FinishedRun], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("innerattn.experiments.paper.findings.choose_scene", lambda _: None)
    shutil.copytree(folder, tmp_path / "study")
    write_report(runs[3:5], tmp_path / "study", "short")  # attention that is even
    gone = {f"{name}.{kind}" for name in FIGURES for kind in ("pdf", "png")} | {"fig5.json"}
    assert {path.name for path in (tmp_path / "study").iterdir()} == ALL - gone


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
    write_report(moved, tmp_path / "report", "short", parts=("table2",))
    assert said in (tmp_path / "report" / "report.md").read_text()
    (other,) = [run for run in runs if (run.method, run.seed) == ("td-uniform", moved[1].seed)]
    with pytest.raises(RunError, match=r"of one seed, and evaluate\.seed is .*: must be the same"):
        refuse_unlike([moved[1], other])


@pytest.mark.long
def test_both_attentions_are_compared_where_both_are_there(folder: Path) -> None:
    text = (folder / "report.md").read_text()
    compared = text.split("## Learnt attention beside uniform")[1].split("## ")[0]
    rows = rows_of(compared)
    assert [row[:2] for row in rows[1:]] == [["mixed", "TD"]]  # single has learnt attention only
    assert rows[1][2:] == [NONE] * 4  # two seeds are too few
    long = rows_of((folder / "table2.md").read_text())
    assert ["mixed", "TD", "score", "2"] in [row[:4] for row in long]


def test_runs_with_and_without_a_warm_start_are_not_one_method(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    warm = tmp_path / "warm"
    shutil.copytree(runs[0].folder, warm)
    config = warm / "config.toml"
    text = config.read_text()
    assert 'warm_start = "none"' in text
    config.write_text(text.replace('warm_start = "none"', 'warm_start = "greedy"'))
    reseal(warm)
    started = read_run(runs[0].case, warm)
    for pair in ([started, runs[1]], [runs[1], started]):
        with pytest.raises(RunError, match=r"listed as the same but for the seed.*train"):
            refuse_unlike(pair)


def test_nothing_is_written_where_a_run_is_missing(runs: list[FinishedRun], tmp_path: Path) -> None:
    with pytest.raises(RunError, match="seed 0; must be one run of each seed"):
        write_report([runs[1], runs[1]], tmp_path / "none", "short")
    assert not (tmp_path / "none").exists()
