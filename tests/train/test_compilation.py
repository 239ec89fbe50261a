"""When a run's updates are compiled, and what happens where they cannot be."""

import json
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from innerattn.config import load_run_config
from innerattn.learn import TD
from innerattn.train import train
from innerattn.train.compilation import compiles

TINY = {"train.env_steps": 128, "train.num_envs": 4, "train.threads": 1}


@pytest.mark.parametrize(
    ("method", "budget", "steps", "expected"),
    [
        ("td-inner", "quick", None, False),
        ("td-inner", "short", None, False),
        ("td-inner", "paper", None, True),
        ("td-inner", "paper", 100_000, False),
        ("ppo-inner", "short", None, False),
        ("ppo-inner", "short", 3_000_000, True),
    ],
)
def test_long_runs_are_compiled(
    method: str, budget: str, steps: int | None, expected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("innerattn.train.compilation._problem", lambda _: None)
    overrides = {} if steps is None else {"train.env_steps": steps}
    config = load_run_config(method=method, budget=budget, overrides=overrides)
    assert compiles(config) is expected


def test_the_choice_wins(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("innerattn.train.compilation._problem", lambda _: None)
    with caplog.at_level(logging.WARNING):
        assert not compiles(load_run_config(budget="paper", overrides={"train.compile": "off"}))
        assert compiles(load_run_config(overrides={"train.compile": "on"}))
        other = {"train.device": "cuda"}  # only asked for, not used
        assert not compiles(load_run_config(budget="paper", overrides=other))
    assert not caplog.records


@pytest.mark.parametrize(("choice", "compiled"), [("on", True), ("off", False)])
def test_a_run_says_whether_it_was_compiled(
    choice: str, compiled: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    monkeypatch.setattr(TD, "compile", lambda self: calls.append(self))
    config = load_run_config(overrides=TINY | {"train.compile": choice})
    train(config, tmp_path / "run")
    assert json.loads((tmp_path / "run" / "run.json").read_text())["compiled"] is compiled
    assert len(calls) == int(compiled)


def test_without_a_compiler_training_goes_on_and_says_so(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "innerattn", "train", "--compile", "on"]
    command += ["--run-dir", str(tmp_path / "run")]
    for key, value in TINY.items():
        command += [f"--{key}", str(value)]
    command += ["--evaluate.score-episodes", "2", "--evaluate.long-episodes", "2"]
    environment = os.environ | {
        "CXX": "no-such-compiler",
        "TORCHINDUCTOR_CACHE_DIR": str(tmp_path / "cache"),
    }
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert json.loads((tmp_path / "run" / "run.json").read_text())["compiled"] is False
    lines = [line for line in done.stderr.splitlines() if "no working compiler" in line]
    assert len(lines) == 1
    assert "Traceback" not in done.stderr
