"""`innerattn train`: a run that is stopped keeps what it has, and can go on."""

import json
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.cli.progress import Evaluating, Training


@contextmanager
def logged(path: Path, tiny: list[str], hangup: signal.Handlers) -> Iterator[subprocess.Popen[str]]:
    """A long run in a process of its own, which has learnt something by now.

    ``hangup`` is what the process finds set for the end of its terminal.
    """
    long = ["--train.env-steps", "100000000", "--train.compile", "off"]
    options = ["--run-dir", str(path), *tiny, *long]
    command = [sys.executable, "-m", "innerattn", "train", *options]
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    before = signal.signal(signal.SIGHUP, hangup)
    try:
        process = subprocess.Popen(command, **streams, text=True)
    finally:
        signal.signal(signal.SIGHUP, before)
    with process:
        try:
            while not (path / "metrics.jsonl").exists():
                assert process.poll() is None
                time.sleep(0.05)
            yield process
        finally:
            process.kill()


@pytest.mark.long
@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGHUP])
def test_a_request_to_end_keeps_the_weights(
    sent: signal.Signals, tiny: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "run"
    with logged(path, tiny, hangup=signal.SIG_DFL) as process:
        process.send_signal(sent)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + sent
    assert f"go on with: innerattn train --resume {path}" in err
    assert json.loads((path / "run.json").read_text())["state"] == "interrupted"


@pytest.mark.long
def test_nohup_outlives_the_terminal(tiny: list[str], tmp_path: Path) -> None:
    path = tmp_path / "run"
    with logged(path, tiny, hangup=signal.SIG_IGN) as process:
        process.send_signal(signal.SIGHUP)
        before = (path / "metrics.jsonl").stat().st_size
        while (path / "metrics.jsonl").stat().st_size == before:
            assert process.poll() is None
            time.sleep(0.05)
        process.terminate()
        process.communicate(timeout=60)
    assert process.returncode == 143


def test_interruption_keeps_the_weights(
    tmp_path: Path,
    tiny: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Training, "__call__", stop)
    path = tmp_path / "run"
    assert main(["train", "--run-dir", str(path), *tiny]) == 130
    assert str(path) in capsys.readouterr().err
    assert json.loads((path / "run.json").read_text())["state"] == "interrupted"
    assert (path / "checkpoints" / "8" / "weights.safetensors").exists()
    assert tomllib.loads((path / "config.toml").read_text())["train"]["num_envs"] == 8
    monkeypatch.undo()

    assert main(["train", "--run-dir", str(path), *tiny]) == 1
    ended = "interrupted after 8 env-steps"
    expected = f"{path}: exists already, {ended}; go on with: innerattn train --resume {path}"
    assert expected in capsys.readouterr().err
    assert main(["train", "--resume", str(path), "--seed", "4"]) == 2
    assert "the run has its own configuration; leave out --seed" in capsys.readouterr().err

    # As a kill leaves it: run.json is further than the newest checkpoint.
    told = json.loads((path / "run.json").read_text())
    told |= {"state": "running", "sealed": False, "env_steps": 12}
    (path / "run.json").write_text(json.dumps(told))
    (path / "manifest.json").unlink()
    assert main(["train", "--resume", str(path)]) == 0
    assert f"Going on with {path} from env-step 8\n" in capsys.readouterr().out
    assert json.loads((path / "run.json").read_text())["state"] == "done"
    assert (path / "evaluation" / "summary.json").exists()
    assert main(["train", "--resume", str(path)]) == 1
    said = capsys.readouterr()
    assert f"{path}: is done" in said.err
    assert said.out == ""


@pytest.mark.long
def test_one_that_saved_nothing_begins_anew(
    tmp_path: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run"
    assert main(["train", "--run-dir", str(path), *tiny]) == 0
    shutil.rmtree(path / "checkpoints")
    (path / "checkpoints").mkdir()
    shutil.rmtree(path / "evaluation")
    (path / "manifest.json").unlink()
    info = path / "run.json"
    told = json.loads(info.read_text())
    before, told["weights_sha256"] = told["weights_sha256"], None
    info.write_text(json.dumps(told | {"state": "running", "sealed": False}))
    capsys.readouterr()
    assert main(["train", "--resume", str(path)]) == 0
    said = f"{path} was stopped before its first checkpoint; it begins anew\n"
    assert said in capsys.readouterr().out
    assert json.loads(info.read_text())["weights_sha256"] == before
    shutil.rmtree(path / "checkpoints")  # it had some: nothing is thrown away
    had = {"state": "running", "sealed": False, "weights_sha256": before}
    info.write_text(json.dumps(told | had))
    (path / "manifest.json").unlink()
    metrics = (path / "metrics.jsonl").read_bytes()
    assert main(["train", "--resume", str(path)]) == 1
    said = f"{path}: holds no checkpoint that training could go on from"
    assert said in capsys.readouterr().err
    assert (path / "metrics.jsonl").read_bytes() == metrics


def test_a_run_that_was_stopped_in_its_evaluation_is_measured(
    tmp_path: Path, tiny: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "run"
    with monkeypatch.context() as patched:
        patched.setattr(Evaluating, "__call__", stop)
        assert main(["train", "--run-dir", str(path), *tiny]) == 130
    assert json.loads((path / "run.json").read_text())["state"] == "done"
    assert main(["train", "--resume", str(path)]) == 0
    assert (path / "evaluation" / "summary.json").exists()
