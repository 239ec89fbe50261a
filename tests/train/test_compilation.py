"""When a run's updates are compiled, and what happens where they cannot be."""

import json
import logging
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import torch._dynamo
from torch import Tensor
from torch.fx import GraphModule

from innerattn.config import load_run_config
from innerattn.learn import TD
from innerattn.learn.actor_critic import ActorCritic
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train import Progress, resume, train
from innerattn.train.compilation import compiles
from innerattn.train.weights import digest_of

TINY = {"train.env_steps": 128, "train.num_envs": 4, "train.threads": 1}


@pytest.mark.long
@pytest.mark.timeout(180)
def test_each_run_of_a_process_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Runs after the compiler's limit of graphs in a process, as those of a worker of a study."""
    compiled_by = ActorCritic.compile
    monkeypatch.setattr(ActorCritic, "compile", lambda self: compiled_by(self, "eager"))
    monkeypatch.setattr("innerattn.train.compilation._problem", lambda _: None)
    few = {"train.method": "ppo-inner", "ppo.rollout_steps": 4, "train.compile": "on"}
    sizes = (16, 8, 4)
    with torch._dynamo.config.patch(recompile_limit=2), caplog.at_level(logging.WARNING):
        for size in sizes:
            config = load_run_config(overrides={**TINY, **few, "ppo.minibatch_size": size})
            train(config, tmp_path / str(size))
    assert not caplog.records
    assert all(read_info(tmp_path / str(size)).compiled for size in sizes)


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


def at_env_step(count: int) -> Callable[[Progress], None]:
    """Stops a training there, in the stage that learns from rewards."""

    def stop(now: Progress) -> None:
        if (now.stage, now.env_steps) == ("training", count):
            raise KeyboardInterrupt

    return stop


@pytest.mark.parametrize(
    ("method", "warm_start"),
    [
        pytest.param("td-inner", "hungarian", marks=pytest.mark.long),
        pytest.param("ppo-inner", "none", marks=pytest.mark.long),
        pytest.param("td-inner", "none", marks=pytest.mark.slow),
        pytest.param("ppo-inner", "hungarian", marks=pytest.mark.slow),
    ],
)
def test_where_the_compiler_fails_the_run_is_that_without_it(
    method: str,
    warm_start: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    def broken(graph: GraphModule, _: Sequence[Tensor]) -> Callable[..., Tensor]:
        raise RuntimeError(f"no {'loop' if graph.graph.nodes else 'graph'}\nmore")

    compiled_by = ActorCritic.compile
    monkeypatch.setattr(ActorCritic, "compile", lambda self: compiled_by(self, broken))
    monkeypatch.setattr("innerattn.train.compilation._problem", lambda _: None)
    few = {
        "train.method": method,
        "train.warm_start": warm_start,
        "imitation.env_steps": 64,
        "imitation.critic_env_steps": 32,
        "td.warmup_env_steps": 16,
        "td.batch_size": 16,
        "td.update_every_env_steps": 8,
        "ppo.rollout_steps": 4,
        "ppo.minibatch_size": 8,
    }
    runs = []
    for choice in ("off", "on"):
        config = load_run_config(overrides={**TINY, **few, "train.compile": choice})
        with caplog.at_level(logging.WARNING):
            runs.append(train(config, tmp_path / choice))
    assert [record.getMessage() for record in caplog.records] == [
        "Updates run uncompiled, which is slower: the compiler fails (RuntimeError: no loop)"
    ]
    assert digest_of(newest_weights(runs[0])) == digest_of(newest_weights(runs[1]))
    caplog.clear()
    cut = tmp_path / "cut"
    with caplog.at_level(logging.WARNING):
        with pytest.raises(KeyboardInterrupt):
            train(config, cut, progress=at_env_step(64))
        resume(cut)  # as it was; the compiler is not tried again
    assert len(caplog.records) == 1
    assert digest_of(newest_weights(cut)) == digest_of(newest_weights(runs[0]))
    infos = [read_info(run) for run in runs]
    assert [(info.state, info.compiled) for info in infos] == [("done", False)] * 2
    assert infos[0].updates == infos[1].updates > 0


@pytest.mark.long
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
