"""Imitation: whose states are labelled, what is learnt when, and runs without it."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.learn.types import Transitions
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.records.run_folder import read_info
from innerattn.train import Progress, load_policy, train
from innerattn.train.build import build_learner
from innerattn.train.collect import Collector
from innerattn.train.imitate import Imitation, _Memory

Configure = Callable[..., RunConfig]

WARM = {
    "train.warm_start": "hungarian",
    "imitation.env_steps": 1200,
    "imitation.critic_env_steps": 400,
    "imitation.batch_size": 32,
    "imitation.update_every_env_steps": 24,
    "imitation.memory_env_steps": 480,
}


class Watched:
    """A learner that moves at random and notes what it is asked; it learns nothing."""

    def __init__(self) -> None:
        self.actor_frozen = False
        self.rng = torch.Generator().manual_seed(0)
        self.met: list[Tensor] = []
        self.taken: list[Tensor] = []
        self.lessons: list[tuple[Tensor, Tensor, float]] = []
        self.critic_steps: list[int] = []

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        assert not greedy  # its own states are those of the policy that will train
        self.met.append(obs)
        self.taken.append(torch.randint(5, obs.shape[:2], generator=self.rng))
        return self.taken[-1]

    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        self.lessons.append((obs, actions, learning_rate))
        return 1.5

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        assert self.actor_frozen  # what is observed now is not of the policy that will learn
        assert torch.equal(batch.obs, self.met[-1])
        assert truncated.shape == (12,)

    def learn(self) -> dict[str, float] | None:
        assert self.actor_frozen
        self.critic_steps.append(len(self.met))
        return {"critic_loss": 0.5}


def one_step(imitation: Imitation, share: float) -> dict[str, float]:
    return imitation.collect(share)[1] | imitation.learn(share)


def watch(config: RunConfig, steps: int) -> tuple[Watched, list[dict[str, float]]]:
    learner = Watched()
    with BatchEnv(config.scenario, 12, seed=0, num_threads=1) as env:
        imitation = Imitation(config, env, learner, Collector(env, learner, torch.device("cpu")))
        assert imitation.env_steps == 1200
        figures = [one_step(imitation, step * 12 / 1200) for step in range(steps)]
    assert not learner.actor_frozen
    return learner, figures


def test_labels_are_of_the_states_that_the_learner_met(small_config: Configure) -> None:
    config = small_config(**WARM)
    learner, figures = watch(config, 100)
    # The same worlds again, driven by the learner's actions and asked for the script's.
    script = scripted_policy("hungarian", config.scenario)
    labels: dict[bytes, tuple[int, list[int]]] = {}
    with BatchEnv(config.scenario, 12, seed=0, num_threads=1) as env:
        obs = env.reset()
        for step, (met, taken) in enumerate(zip(learner.met, learner.taken, strict=True)):
            np.testing.assert_array_equal(met, obs)
            wanted = script.act(PolicyInput(obs, WorldState.of(env)))
            assert figures[step]["agreement"] == pytest.approx((taken.numpy() == wanted).mean())
            for world in range(12):
                labels[obs[world].tobytes()] = (step, wanted[world].tolist())
            obs = env.step(taken.numpy()).obs
    # A lesson comes every 24 env-steps and draws from the newest 480, which are 40 control steps.
    assert len(learner.lessons) == 50
    ages = []
    for number, (states, actions, _) in enumerate(learner.lessons):
        assert actions.dtype == torch.int64
        for state, action in zip(states, actions, strict=True):
            step, label = labels[state.numpy().tobytes()]
            assert action.tolist() == label
            ages.append(2 * number + 1 - step)
    assert min(ages) == 0
    assert 30 < max(ages) < 40
    rates = [rate for *_, rate in learner.lessons]
    assert rates == pytest.approx(np.interp(range(1, 100, 2), [0, 100], [2e-3, 4e-5]))


def test_the_critic_learns_in_the_last_part_alone(small_config: Configure) -> None:
    learner, figures = watch(small_config(**WARM), 100)
    assert learner.critic_steps == list(range(68, 101))  # from 800 env-steps on
    assert ["critic_loss" in found for found in figures] == [False] * 67 + [True] * 33
    assert {found["imitation_loss"] for found in figures[1::2]} == {1.5}
    assert not any("imitation_loss" in found for found in figures[::2])


@pytest.mark.parametrize("method", ["td-inner", "ppo-inner"])
def test_a_warm_start_says_so_and_repeats_itself(
    small_config: Configure, tmp_path: Path, method: str
) -> None:
    config = small_config(**WARM, **{"train.method": method})
    seen: list[Progress] = []
    run = train(config, tmp_path / "run", progress=seen.append)
    assert [progress.stage for progress in seen] == ["imitating"] * 100 + ["training"] * 50
    assert [(p.env_steps, p.total_env_steps) for p in (seen[0], seen[99], seen[100], seen[-1])] == [
        (12, 1200),
        (1200, 1200),
        (12, 600),
        (600, 600),
    ]
    info = read_info(run)
    assert (info.warm_start, info.env_steps) == ("hungarian", 1800)
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    logged = [line["env_steps"] for line in lines]
    assert logged == [204, 408, 600, 804, 1008, 1200, 1404, 1608, 1800]
    for line in lines:
        imitated = {"imitation_loss", "agreement"} & line["losses"].keys()
        assert len(imitated) == (2 if line["env_steps"] <= 1200 else 0)
    assert lines[5]["losses"]["imitation_loss"] < lines[0]["losses"]["imitation_loss"]
    first, again = (
        load_policy(path)[1].state() for path in (run, train(config, tmp_path / "again"))
    )
    assert all(torch.equal(first[name], again[name]) for name in first)


def test_without_a_warm_start_its_numbers_change_nothing(
    small_config: Configure, finished_run: Path, tmp_path: Path
) -> None:
    config = small_config(**{**WARM, "train.warm_start": "none"})
    first, other = (
        load_policy(path)[1].state() for path in (finished_run, train(config, tmp_path / "run"))
    )
    assert all(torch.equal(first[name], other[name]) for name in first)
    assert read_info(finished_run).warm_start == "none"


def test_an_interrupted_imitation_is_kept(small_config: Configure, tmp_path: Path) -> None:
    def press_ctrl_c(progress: Progress) -> None:
        if progress.env_steps == 600:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(small_config(**WARM), tmp_path / "run", progress=press_ctrl_c)
    assert (read_info(tmp_path / "run").state, read_info(tmp_path / "run").env_steps) == (
        "interrupted",
        600,
    )
    load_policy(tmp_path / "run")


def test_continuous_actions_are_refused(small_config: Configure) -> None:
    with pytest.raises(
        ConfigError, match=r"train\.warm_start = 'hungarian': scenario\.actions"
    ) as e:
        small_config(**WARM, **{"scenario.actions": "continuous", "train.method": "ppo-inner"})
    assert "\n" not in str(e.value)


@pytest.mark.long
def test_agreement_with_the_script_grows(small_config: Configure) -> None:
    numbers = {
        "imitation.env_steps": 48_000,
        "imitation.batch_size": 128,
        "imitation.memory_env_steps": 48_000,
        "imitation.update_every_env_steps": 96,
        "imitation.learning_rate": 0.005,
        "train.num_envs": 96,
        "network.hidden_width": 64,
    }
    config = small_config(**{**WARM, **numbers})
    with BatchEnv(config.scenario, 96, seed=0, num_threads=1) as env:
        learner = build_learner(config, env)
        imitation = Imitation(config, env, learner, Collector(env, learner, torch.device("cpu")))
        agreement = [one_step(imitation, step / 500)["agreement"] for step in range(500)]
    assert sum(agreement[:5]) / 5 < 0.3
    assert sum(agreement[-50:]) / 50 > 0.5


def test_of_more_states_than_it_holds_a_memory_keeps_the_last() -> None:
    memory = _Memory((5, 2, 3), seed=0)
    for start, count in ((0, 3), (3, 12), (15, 1)):
        labels = torch.arange(start, start + count)
        memory.add(labels.float()[:, None, None].expand(-1, 2, 3), labels[:, None].expand(-1, 2))
    obs, actions = memory.sample(200)
    assert set(actions.unique().tolist()) == {11, 12, 13, 14, 15}
    assert (obs[..., 0].long() == actions).all()
