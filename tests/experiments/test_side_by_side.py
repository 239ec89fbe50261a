"""`innerattn train --seeds`: the same runs as one by one, and nothing left behind."""

import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import replace
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest

from innerattn.cli import train as command
from innerattn.cli.main import main
from innerattn.cli.progress import SeveralRuns
from innerattn.config import RunConfig, load_run_config
from innerattn.experiments.processes import work
from innerattn.experiments.side_by_side import Run, trained_share
from innerattn.train import Progress
from innerattn.train.weights import read_weights

TIMES = ("seconds", "env_steps_per_s", "updates_per_s")


def state(folder: Path) -> str:
    return str(json.loads((folder / "run.json").read_text())["state"])


def processes() -> list[BaseProcess]:
    return multiprocessing.active_children()


def number(process: BaseProcess) -> int:
    """The how-manieth process of this one it is: its name ends with that (SpawnProcess-10)."""
    return int(process.name.rpartition("-")[2])


def weights(folder: Path) -> dict[str, bytes]:
    (path,) = folder.glob("checkpoints/*/weights.safetensors")
    return {name: tensor.numpy().tobytes() for name, tensor in read_weights(path).items()}


def configured(options: Sequence[str]) -> RunConfig:
    keys = [option.removeprefix("--").replace("-", "_") for option in options[::2]]
    return load_run_config(overrides=dict(zip(keys, map(int, options[1::2]), strict=True)))


def metrics(folder: Path) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
    return [{key: line[key] for key in line if key not in TIMES} for line in lines]


@pytest.fixture
def on_change(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Sequence[Run]], None]], None]:
    """Has something done each time that one of several runs is further."""

    def have(do: Callable[[Sequence[Run]], None]) -> None:
        monkeypatch.setattr(SeveralRuns, "__call__", lambda _, runs: do(runs))

    return have


@pytest.mark.long
def test_runs_are_those_of_single_commands_and_a_failure_leaves_them_alone(
    run_dir: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    on_change: Callable[[Callable[[Sequence[Run]], None]], None],
) -> None:
    seen: list[list[str]] = []

    def kill_the_second(runs: Sequence[Run]) -> None:
        if not seen:
            max(processes(), key=number).kill()
        seen.append([run.state for run in runs])

    on_change(kill_the_second)
    monkeypatch.setattr(command, "usable_cores", lambda: 2)
    path = tmp_path / "tiny"
    without_threads = [word for word in tiny if word not in ("--train.threads", "1")]
    assert len(without_threads) == len(tiny) - 2
    assert main(["train", "--seeds", "5,1,3", "--run-dir", str(path), *without_threads]) == 1
    out, err = capsys.readouterr()
    assert err == "innerattn: error: seed 1: its process ended with signal 9\n"
    assert seen[0] == ["running", "running", "waiting"]
    assert seen[-1] == ["done", "failed", "done"]

    fifth = tmp_path / "alone" / "tiny-s5"
    assert main(["train", "--seed", "5", "--run-dir", str(fifth), *tiny]) == 0
    for one, alone in ((tmp_path / "tiny-s3", run_dir), (tmp_path / "tiny-s5", fifth)):
        assert state(one) == "done"
        assert (one / "config.toml").read_bytes() == (alone / "config.toml").read_bytes()
        assert metrics(one) == metrics(alone)
        assert weights(one) == weights(alone)
        for file in (alone / "evaluation").iterdir():
            found = (one / "evaluation" / file.name).read_bytes()
            assert found.replace(one.name.encode(), alone.name.encode()) == file.read_bytes()

    rows = {cells[0]: cells for line in out.splitlines() if (cells := line.split())}
    for seed in (5, 3):
        text = (tmp_path / f"tiny-s{seed}" / "evaluation" / "summary.json").read_text()
        summary = json.loads(text)
        assert rows[str(seed)][1] == f"{summary['rescues_per_episode']['mean']:.2f}"
        assert rows[str(seed)][3] == f"{summary['long']['rescues_per_episode']['mean']:.2f}"
    assert rows["1"] == ["1", "failed"]
    assert rows["mean"][:3] == ["mean", "of", "2"]
    assert f"  {path}-s5 (done)\n  {path}-s1 (failed)\n  {path}-s3 (done)\n" in out


@pytest.mark.parametrize(
    "sent",
    [
        signal.SIGINT,
        pytest.param(signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, marks=pytest.mark.slow),
    ],
)
@pytest.mark.long
def test_ctrl_c_saves_every_run_and_leaves_no_process(
    sent: signal.Signals,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    on_change: Callable[[Callable[[Sequence[Run]], None]], None],
) -> None:
    def press_ctrl_c(runs: Sequence[Run]) -> None:
        """As a terminal sends it: to every process, too early for some to hear it well."""
        for process in processes():
            os.kill(process.pid or 0, sent)
        if all(run.share > 0.0 for run in runs[:2]):
            raise KeyboardInterrupt

    on_change(press_ctrl_c)
    monkeypatch.setattr(command, "usable_cores", lambda: 2)
    path = tmp_path / "run"
    long = [*tiny, "--train.env-steps", "10000000", "--train.compile", "off"]
    assert main(["train", "--seeds", "0..2", "--run-dir", str(path), *long]) == 130
    kept = [
        f"innerattn: what was learnt is kept in {path}-s{seed}; go on with: "
        f"innerattn train --resume {path}-s{seed}"
        for seed in (0, 1)
    ]
    assert capfd.readouterr().err.splitlines() == [*kept, "innerattn: interrupted"]
    assert processes() == []
    for seed in (0, 1):
        assert state(tmp_path / f"run-s{seed}") == "interrupted"
        assert weights(tmp_path / f"run-s{seed}")
    assert not (tmp_path / "run-s2").exists()


def test_a_run_that_fails_says_why(tiny: list[str], tmp_path: Path) -> None:
    config, pipe, its_end = configured(tiny), *multiprocessing.Pipe()
    work(Run(config, tmp_path), its_end, debug=False)
    assert pipe.recv() == ("running", 0.0)
    reason = f"{tmp_path}: exists already; choose another run folder or remove it"
    assert pipe.recv() == ("failed", reason)


def test_a_run_stops_when_nobody_listens(tiny: list[str], tmp_path: Path) -> None:
    config, pipe, its_end = configured(tiny), *multiprocessing.Pipe()
    pipe.close()
    work(Run(config, tmp_path / "run"), its_end, debug=False)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_folder_is_refused_before_anything_starts(
    tiny: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run-s1").mkdir()
    assert main(["train", "--seeds", "0..1", "--run-dir", str(tmp_path / "run"), *tiny]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"innerattn: error: {tmp_path / 'run-s1'}: exists already")
    assert [entry.name for entry in tmp_path.iterdir()] == ["run-s1"]


def test_what_no_run_can_do_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["train", "--seeds", "0..1", "--device", "abacus"]) == 1
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("innerattn: error: train.device = 'abacus'")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "threads", "at_once"),
    [([], 1, 7), (["--train.threads", "2"], 2, 3), (["--train.threads", "9"], 9, 1)],
)
def test_processes_and_threads(
    options: list[str],
    threads: int,
    at_once: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[list[RunConfig], list[str], int]] = []

    def note(runs: Sequence[Run], processes: int, **_: object) -> None:
        asked.append(([run.config for run in runs], [run.folder.name for run in runs], processes))

    monkeypatch.setattr(command, "run_side_by_side", note)
    monkeypatch.setattr(command, "usable_cores", lambda: 7)
    monkeypatch.chdir(tmp_path)
    assert main(["train", "--seeds", "0..8", *options]) == 0
    ((configs, names, processes),) = asked
    assert [config.train.seed for config in configs] == list(range(9))
    assert {config.train.threads for config in configs} == {threads}
    assert processes == at_once
    stamps = {name.removeprefix(f"mixed-td-inner-quick-s{i}-") for i, name in enumerate(names)}
    assert len(stamps) == 1


def test_the_share_done_grows_through_a_warm_start() -> None:
    overrides = {"train.env_steps": 300, "imitation.env_steps": 100}
    warm = load_run_config(overrides={**overrides, "train.warm_start": "greedy"})
    imitating = Progress(50, 100, 0, 0.0, None, "imitating")
    training = Progress(0, 300, 0, 0.0, None, "training")
    assert trained_share(warm, imitating) == 0.125
    assert trained_share(warm, training) == 0.25
    assert trained_share(warm, replace(training, env_steps=300)) == 1.0
    cold = load_run_config(overrides=overrides)
    assert trained_share(cold, replace(training, env_steps=150)) == 0.5
