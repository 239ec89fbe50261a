"""Workers that torchrun has started learn what those learn that `train` has started."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_runs import left_by

from innerattn.config import RunConfig, load_run_config, write_toml
from innerattn.errors import ConfigError
from innerattn.records.run_folder import read_info
from innerattn.train import train
from innerattn.train.workers.choose import with_number_of_workers

VALUES = {
    "train.workers": 2,
    "train.method": "td-inner",
    "train.num_envs": 12,
    "train.env_steps": 480,
    "train.log_every_env_steps": 120,
    "train.checkpoint_every_env_steps": 120,
    "td.batch_size": 16,
    "td.replay_capacity": 300,
    "td.update_every_env_steps": 5,
    "td.warmup_env_steps": 100,
    "network.hidden_width": 16,
    "evaluate.episodes": 2,
    "evaluate.score_episodes": 2,
    "evaluate.long_episodes": 2,
}


def started(folder: Path, *options: str) -> subprocess.Popen[str]:
    """`torchrun` with the command that trains."""
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
    command = [*torchrun, "--nproc-per-node=2", "-m", "innerattn", "train", *options]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def config(**values: object) -> RunConfig:
    return load_run_config("mixed", overrides={**VALUES, **values})


@pytest.mark.long
def test_the_same_bits_as_with_one_command(tmp_path: Path) -> None:
    write_toml(config(), tmp_path / "config.toml")
    with started(tmp_path, "--config", "config.toml", "--run-dir", "run") as process:
        out, error = process.communicate(timeout=120)
    assert process.returncode == 0, error
    assert out.count("Run folder: run") == 1  # the first worker alone prints
    whole = train(config(), tmp_path / "whole")
    assert left_by(tmp_path / "run") == left_by(whole)
    summary = json.loads((tmp_path / "run" / "evaluation" / "summary.json").read_text())
    assert summary


@pytest.mark.slow
def test_a_request_to_end_saves_what_all_have(tmp_path: Path) -> None:
    long = config(**{"train.env_steps": 10_000_000})
    write_toml(long, tmp_path / "config.toml")
    latest = tmp_path / "run" / "checkpoints" / "latest"
    with started(tmp_path, "--config", "config.toml", "--run-dir", "run") as process:
        while not latest.exists():
            assert process.poll() is None, process.communicate()
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)
    info = read_info(tmp_path / "run")
    assert info.state == "interrupted"
    assert int(latest.read_text()) == info.env_steps


def test_another_number_than_torchrun_started_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {"TORCHELASTIC_RUN_ID": "a", "WORLD_SIZE": "2", "RANK": "0"}.items():
        monkeypatch.setenv(name, value)
    wrong = config(**{"train.workers": 3, "td.batch_size": 15})
    with pytest.raises(ConfigError) as found:
        train(wrong, tmp_path / "run")
    assert str(found.value) == "train.workers = 3: must be 2, as many as torchrun started"
    assert not (tmp_path / "run").exists()


def test_what_torchrun_started_is_as_many_as_pay(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"TORCHELASTIC_RUN_ID": "a", "WORLD_SIZE": "4", "RANK": "1"}.items():
        monkeypatch.setenv(name, value)
    chosen = with_number_of_workers(config(**{"train.workers": "auto"}))
    assert chosen.train.workers == 4
