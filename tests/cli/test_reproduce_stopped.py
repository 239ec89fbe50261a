"""`innerattn reproduce`: goes on after what failed, was stopped or was killed."""

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pytest
from reseal import reseal
from small_study import NAMES, Command, account, states, times, weights

from innerattn.errors import RunError
from innerattn.experiments.lock import StudyLock
from innerattn.experiments.side_by_side import Run


def test_ctrl_c_while_faults_are_measured_keeps_the_runs(
    study: Path,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def press_ctrl_c(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("innerattn.experiments.processes.run_side_by_side", press_ctrl_c)
    assert command("robustness", study, "td-uniform", "--seeds", "1") == 130
    err = capsys.readouterr().err.splitlines()
    assert err[0].startswith("innerattn: 1 of 1 runs are finished and kept")
    assert states(study) == ["finished"]


def test_a_run_that_is_not_measured_is_measured_and_not_trained(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    left, kept = (study / "runs" / name for name in NAMES)
    before, trained = times(kept), times(left / "checkpoints")
    lost = left / "evaluation" / "summary.json"
    summary = lost.read_bytes()
    lost.unlink()
    assert command("table2", study, "td-inner,td-uniform", "--seeds", "1") == 0
    assert "1 finished, 0 to train, 1 to measure only, 1 at a time" in capsys.readouterr().out
    assert lost.read_bytes() == summary
    assert (times(kept), times(left / "checkpoints")) == (before, trained)


@pytest.mark.usefixtures("in_this_process")
def test_an_unfinished_run_is_trained_again(study: Path, command: Command) -> None:
    left, kept = (study / "runs" / name for name in NAMES)
    info = json.loads((left / "run.json").read_text())
    (left / "run.json").write_text(json.dumps(info | {"state": "interrupted"}))
    reseal(left)
    (left / "of an earlier try").touch()
    before_it = weights(left)
    before = times(kept)
    assert command("table2", study, "td-inner,td-uniform", "--seeds", "1") == 0
    assert not (left / "of an earlier try").exists()
    assert weights(left) == before_it
    assert times(kept) == before
    assert sorted(path.name for path in (study / "runs").iterdir()) == sorted(NAMES)


@pytest.mark.usefixtures("in_this_process")
def test_a_run_that_diverges_is_named_and_the_others_are_trained(
    tmp_path: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    study = partial(command, "fig5", tmp_path, "all", "--seeds", "1")
    for _ in range(2):  # the second try fails as well
        assert study(**{"td.reward_scale": 1e-37}) == 1
        out, err = capsys.readouterr()
        assert err.startswith("innerattn: error: mixed td-inner seed 0: training diverged at ")
        assert err.count("\n") == 1
        assert "  mixed td-inner seed 0: failed: training diverged at " in out
        assert states(tmp_path) == ["failed", "finished"]
    assert "1 finished, 1 to train" in out
    (failure,) = json.loads((tmp_path / "failures.json").read_text())["failures"]
    assert failure["folder"] == NAMES[0]
    assert failure["reason"] == account(tmp_path)["runs"][0]["why"]


@pytest.mark.usefixtures("in_this_process")
def test_a_failure_is_forgotten_once_the_run_succeeds(study: Path, command: Command) -> None:
    (study / "runs" / NAMES[0] / "evaluation" / "summary.json").unlink()
    failures = {"schema_version": 1, "failures": [{"folder": NAMES[0], "reason": "it fell"}]}
    (study / "failures.json").write_text(json.dumps(failures))
    assert command("table2", study, "td-inner", "--seeds", "1") == 0
    assert json.loads((study / "failures.json").read_text())["failures"] == []


def test_ctrl_c_keeps_what_is_finished(
    study: Path,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def press_ctrl_c(runs: Sequence[Run], *_: object, **__: object) -> None:
        assert [run.folder.name for run in runs] == ["mixed-td-inner-quick-s1"]
        raise KeyboardInterrupt

    monkeypatch.setattr("innerattn.experiments.train.train_side_by_side", press_ctrl_c)
    assert command("fig5", study, "td-inner", "--seeds", "2") == 130
    err = capsys.readouterr().err.splitlines()
    assert err[0].startswith("innerattn: 1 of 2 runs are finished and kept")
    assert err[1:] == ["innerattn: interrupted"]
    assert states(study) == ["finished", "missing"]


KILLED = """
import sys
from dataclasses import replace
from functools import partial
from innerattn.cli.main import main
from innerattn.report.targets import TARGETS
if __name__ == "__main__":
    plan = partial(TARGETS["fig4"].plan, overrides={overrides!r})
    TARGETS["fig4"] = replace(TARGETS["fig4"], plan=plan)
    main(["reproduce", "fig4", "--seeds", "1", "--out", sys.argv[1], "--methods",
          "td-inner,td-uniform", "--presets", "mixed"])
"""


def test_a_killed_study_goes_on(
    study: Path, small: dict[str, object], command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its processes end by themselves, and only then can the next study begin."""
    left, kept = (study / "runs" / name for name in NAMES)
    shutil.rmtree(left)
    config = kept / "config.toml"  # as if it had been trained for as long as the one that is killed
    config.write_text(config.read_text().replace("env_steps = 96\n", "env_steps = 10000000\n"))
    reseal(kept)
    before = times(kept)
    script = study.parent / "killed.py"
    script.write_text(KILLED.format(overrides={**small, "train.env_steps": 10_000_000}))
    process = subprocess.Popen([sys.executable, str(script), str(study)], stdout=subprocess.PIPE)
    wait_for((left / "run.json").exists)
    process.kill()
    process.communicate()
    wait_for(lambda: can_be_locked(study))
    assert json.loads((left / "run.json").read_text())["state"] == "interrupted"

    asked: list[Path] = []

    def note(runs: Sequence[Run], *_: object, **__: object) -> None:
        asked.extend(run.folder for run in runs)
        assert [run.begun for run in runs] == [left.exists()] == [True]

    monkeypatch.setattr("innerattn.experiments.train.train_side_by_side", note)
    values = {"train.env_steps": 10_000_000}
    assert command("fig4", study, "td-inner,td-uniform", "--seeds", "1", **values) == 1
    assert asked == [left]
    assert states(study) == ["unfinished", "finished"]
    assert times(kept) == before


def can_be_locked(study: Path) -> bool:
    try:
        with StudyLock.take(study):
            return True
    except RunError:
        return False


def wait_for(done: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not done():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_study_at_work_is_left_alone(
    study: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    before = times(study)
    with StudyLock.take(study):
        assert command("table2", study, "td-inner", "--seeds", "2") == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"innerattn: error: {study}: another study is at work here")
    assert err.count("\n") == 1
    (study / ".lock").unlink()
    assert times(study / "runs").items() <= before.items()
