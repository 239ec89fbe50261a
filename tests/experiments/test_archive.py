"""A run kept in small: a study takes it for the run, and makes the same report of it."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from innerattn.errors import RunError
from innerattn.experiments.archive import keep
from innerattn.experiments.plan import plan
from innerattn.experiments.run import StudyRun, digests, read_measured
from innerattn.experiments.scan import FinishedRun, scan_runs
from innerattn.records.parquet import read_records
from innerattn.records.run_folder import read_info
from innerattn.report.crossed import write_crossed

LEFT_OUT = ("checkpoints", "metrics.jsonl")


def test_the_copy_is_the_run_without_what_is_large(runs: list[StudyRun], tmp_path: Path) -> None:
    for run in runs:
        small = tmp_path / "kept" / run.folder.name
        keep(run, small)
        assert {path.name for path in run.folder.iterdir()} - {
            path.name for path in small.iterdir()
        } == set(LEFT_OUT)
        assert digests(small) == digests(run.folder)
        assert read_info(small).weights_sha256 == digests(run.folder).weights
        whole, copy = (
            read_measured(one, step_by_step=False) for one in (run, replace(run, folder=small))
        )
        assert copy.summary == whole.summary
        for mine, its in zip(copy.scored, whole.scored, strict=True):
            assert mine.rescues.tobytes() == its.rescues.tobytes()
            assert mine.lengths.tolist() == its.lengths.tolist()
            assert mine.rewards_total.tobytes() == its.rewards_total.tobytes()
            assert mine.steps == {}
        assert {record.policy for record in read_records(small / "evaluation")} == {run.method}
        with pytest.raises(RunError, match="recorded step by step"):
            read_measured(replace(run, folder=small))
    assert [path.name for path in (tmp_path / "kept").glob(".*")] == []


def test_a_study_goes_on_with_kept_runs(
    study: Path, small: dict[str, object], tmp_path: Path
) -> None:
    planned = plan(("td-inner", "td-uniform"), ("mixed",), (0, 1), "quick", tmp_path, small)
    for one in planned[:2]:
        case, source = one.case, study / "runs" / one.folder.name
        keep(StudyRun(case.situation, case.method, case.seed, source), one.folder)
    states = [one.state for one in scan_runs(planned, tmp_path)]
    assert states == ["finished", "finished", "missing", "missing"]


def test_kept_runs_give_the_same_report(
    crossed_study: tuple[Path, list[FinishedRun]], tmp_path: Path
) -> None:
    out, runs = crossed_study
    kept = []
    for run in runs:
        folder = tmp_path / "runs" / run.folder.name
        keep(StudyRun(run.case.situation, run.case.method, run.case.seed, run.folder), folder)
        kept.append(replace(run, folder=folder))
    names = [f"crossed.{kind}" for kind in ("md", "json", "csv")]
    write_crossed(runs, out, "quick")
    write_crossed(kept, tmp_path, "quick")
    for name in names:
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


def test_what_is_there_stays(runs: list[StudyRun], tmp_path: Path) -> None:
    small = tmp_path / "run"
    keep(runs[0], small)
    before = {path: path.stat().st_mtime_ns for path in small.rglob("*")}
    keep(runs[0], small)
    with pytest.raises(RunError, match="holds another run than"):
        keep(runs[1], small)
    assert {path: path.stat().st_mtime_ns for path in small.rglob("*")} == before


def test_a_run_that_is_not_whole_is_not_kept(runs: list[StudyRun], tmp_path: Path) -> None:
    shutil.copytree(runs[0].folder, tmp_path / "run")
    (tmp_path / "run" / "evaluation" / "summary.json").unlink()
    with pytest.raises(RunError, match="no finished evaluation"):
        keep(replace(runs[0], folder=tmp_path / "run"), tmp_path / "kept" / "run")
    assert not (tmp_path / "kept").exists()
    shutil.rmtree(tmp_path / "run" / "checkpoints")
    with pytest.raises(RunError, match="holds no checkpoint yet"):
        digests(tmp_path / "run")
