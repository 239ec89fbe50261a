"""Whole runs: what they leave behind when they end, are interrupted, or cannot begin."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from best_line import best_line

from innerattn.config import RunConfig, load_run_config
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, RunError
from innerattn.evaluate.play import run_episodes
from innerattn.learn.types import Learner
from innerattn.policies import scripted_policy
from innerattn.records.run_folder import read_info
from innerattn.train import Progress, load_policy, parts, prepare, train
from innerattn.train.build import build_learner, team_of, thread_count

Configure = Callable[..., RunConfig]


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("changed", "wanted"),
    [
        ({}, False),
        ({"scenario.end_when_rescued": 3}, True),
        ({"scenario.situation": "listed"}, False),
        ({"scenario.situation": "listed", "scenario.end_when_done": True}, True),
    ],
)
def test_learners_know_whether_episodes_may_end_early(
    changed: dict[str, object], wanted: bool
) -> None:
    config = load_run_config(overrides=changed)
    assert team_of(config, BatchEnv(config.scenario, 1)).terminates == wanted


def test_a_finished_run_holds_what_is_promised(finished_run: Path) -> None:
    assert files(finished_run) == {
        "config.toml",
        "run.json",
        "manifest.json",
        "metrics.jsonl",
        "checkpoints/latest",
        "checkpoints/600/weights.safetensors",
        f"checkpoints/best-{best_line(finished_run)}.safetensors",
    }
    info = read_info(finished_run)
    assert (info.state, info.env_steps, info.seed, info.threads) == ("done", 600, 0, 1)
    assert info.updates == load_policy(finished_run)[1].updates > 0


def test_metrics_of_a_run(finished_run: Path) -> None:
    text = (finished_run / "metrics.jsonl").read_text()
    lines = [json.loads(line) for line in text.splitlines()]
    assert [line["env_steps"] for line in lines] == [204, 408, 600]
    # Episodes of 25 steps in 12 worlds: the first end with the 300th env-step.
    assert [line["episodes"] for line in lines] == [0, 12, 24]
    assert lines[0]["rescues_per_episode"] is None
    assert lines[1]["rescues_per_episode"] >= 0
    assert lines[2]["updates"] == read_info(finished_run).updates
    assert lines[2]["losses"]["critic_loss"] > 0
    for line in lines:
        assert set(line["attention_entropy"]) == {"food_0", "food_1", "navigation_0", "medical_0"}
        for heads in line["attention_entropy"].values():
            assert len(heads) == 4
            assert all(0 < nats <= 1.0987 for nats in heads)


def test_the_same_run_twice_gives_the_same_weights(
    small_config: Configure, finished_run: Path, tmp_path: Path
) -> None:
    again = load_policy(train(small_config(), tmp_path / "again"))[1].state()
    first = load_policy(finished_run)[1].state()
    assert all(torch.equal(first[name], again[name]) for name in first)
    other = load_policy(train(small_config(**{"train.seed": 1}), tmp_path / "other"))[1].state()
    assert not all(torch.equal(first[name], other[name]) for name in first)


def test_a_training_has_no_start_of_an_evaluation_with_its_seed(
    small_config: Configure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[BatchEnv] = []

    def remembered(*args: Any, **options: Any) -> BatchEnv:
        made.append(BatchEnv(*args, **options))
        starts.append(made[-1].state())
        return made[-1]

    starts: list[Any] = []
    monkeypatch.setattr(prepare, "BatchEnv", remembered)
    config = small_config(**{"train.seed": 12_345})
    train(config, tmp_path / "run")
    script = scripted_policy("random", config.scenario)
    record = run_episodes(script, config.scenario, 12, 12_345, record=("positions",))
    evaluated = record.steps["positions"][:, 0, :, 0].ravel()
    trained = starts[0][:, ::4][:, : config.scenario.num_robots].ravel()
    assert trained.shape == evaluated.shape
    assert not np.isin(trained, evaluated).any()
    again = run_episodes(
        script, config.scenario, 12, 12_345, record=("positions",), purpose="training"
    )
    np.testing.assert_array_equal(again.steps["positions"][:, 0, :, 0].ravel(), trained)


def test_progress_is_reported_each_step(small_config: Configure, tmp_path: Path) -> None:
    seen: list[Progress] = []
    train(small_config(**{"train.env_steps": 250}), tmp_path / "run", progress=seen.append)
    assert [progress.env_steps for progress in seen] == list(range(12, 253, 12))
    assert {progress.total_env_steps for progress in seen} == {250}
    assert seen[0].metrics is None
    assert seen[-1].metrics is not None
    assert seen[-1].metrics["env_steps"] == 252


@pytest.mark.parametrize("after", [1, 30])
def test_an_interrupt_saves_and_is_passed_on(
    small_config: Configure, tmp_path: Path, after: int
) -> None:
    seen: list[Progress] = []

    def press_ctrl_c(progress: Progress) -> None:
        seen.append(progress)
        if len(seen) == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(small_config(), tmp_path / "run", progress=press_ctrl_c)
    info = read_info(tmp_path / "run")
    assert (info.state, info.env_steps) == ("interrupted", 12 * after)
    _, learner = load_policy(tmp_path / "run")
    assert learner.updates == info.updates == seen[-1].updates


def test_divergence_ends_a_run_at_once(small_config: Configure, tmp_path: Path) -> None:
    # Rewards weigh so little beside the entropy that a float32 loss overflows in the first update,
    # long before the only line of metrics.
    config = small_config(**{"td.reward_scale": 1e-37, "train.log_every_env_steps": 10_000})
    with pytest.raises(RunError, match=r"env_steps = 252: losses\.critic_loss = inf: must be"):
        train(config, tmp_path / "run")
    info = read_info(tmp_path / "run")
    assert (info.state, info.env_steps) == ("interrupted", 252)
    with pytest.raises(RunError, match="holds no checkpoint yet"):
        load_policy(tmp_path / "run")


@pytest.mark.parametrize("interrupted", [False, True])
def test_broken_weights_are_never_saved(
    small_config: Configure,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    interrupted: bool,
) -> None:
    def poisoned(config: RunConfig, env: BatchEnv, *, training: bool) -> Learner:
        learner = build_learner(config, env, training=training)
        state = learner.state()
        next(tensor for name, tensor in state.items() if name.startswith("actor.")).fill_(math.nan)
        learner.load(state)
        return learner

    def press_ctrl_c(_: Progress) -> None:
        if interrupted:
            raise KeyboardInterrupt

    monkeypatch.setattr(parts, "build_learner", poisoned)
    # The run ends before the first update: no loss tells.
    config = small_config(**{"train.env_steps": 120})
    with pytest.raises(RunError, match=r"a value of actor\.\S+ is nan: must be finite"):
        train(config, tmp_path / "run", progress=press_ctrl_c)
    info = read_info(tmp_path / "run")
    assert (info.state, info.env_steps) == ("interrupted", 12 if interrupted else 120)
    with pytest.raises(RunError, match="holds no checkpoint yet"):
        load_policy(tmp_path / "run")


def test_an_existing_folder_is_refused_untouched(small_config: Configure, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "mine.txt").write_text("mine")
    with pytest.raises(RunError, match="exists already"):
        train(small_config(), folder)
    assert files(tmp_path) == {"run/mine.txt"}


@pytest.mark.parametrize(
    ("values", "place"),
    [
        ({"train.device": "abacus"}, r"train\.device = 'abacus'"),
        ({"train.device": "cuda:99"}, r"train\.device = 'cuda:99': not usable here, must be 'cpu'"),
        ({"train.device": "meta"}, r"train\.device = 'meta'"),
        ({"scenario.actions": "continuous"}, r"scenario\.actions = 'continuous'"),
    ],
)
def test_a_run_that_cannot_begin_leaves_nothing(
    small_config: Configure, tmp_path: Path, values: dict[str, object], place: str
) -> None:
    with pytest.raises(ConfigError, match=place) as caught:
        train(small_config(**values), tmp_path / "runs" / "run")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_torch_threads_are_as_before(small_config: Configure, tmp_path: Path) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    inside: list[int] = []
    try:
        train(
            small_config(**{"train.env_steps": 12}),
            tmp_path / "run",
            progress=lambda _: inside.append(torch.get_num_threads()),
        )
        assert (inside, torch.get_num_threads()) == ([1], 2)
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("cores", [1, 2, 8])
@pytest.mark.parametrize(("rows", "threads"), [(1, 1), (512, 1), (1024, 2), (6400, 12)])
@pytest.mark.parametrize(
    ("method", "key"), [("td-inner", "td.batch_size"), ("ppo-inner", "ppo.minibatch_size")]
)
def test_networks_get_a_thread_for_each_512_rows(
    rows: int, threads: int, cores: int, method: str, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("innerattn.train.build.usable_cores", lambda: cores)
    config = load_run_config(method=method, overrides={key: rows})
    assert thread_count(config) == min(threads, cores)


@pytest.mark.parametrize("method", ["td-uniform", "ppo-inner", "mappo"])
def test_swapped_robots_begin_with_each_others_weights(method: str) -> None:
    def initial(**network: object) -> dict[str, torch.Tensor]:
        config = load_run_config(method=method, overrides=network)
        with BatchEnv(config.scenario, 1) as env:
            return build_learner(config, env).state()

    drawn = initial()
    swapped = initial(**{"network.swapped_robots": ("food_0", "food_1")})
    moved = 0
    for name, weights in drawn.items():
        if name.endswith((".weight", ".bias")) and ".attention." not in name:
            assert torch.equal(swapped[name], weights[[1, 0, 2, 3]]), name
            moved += not torch.equal(swapped[name], weights)
    assert moved >= 12
