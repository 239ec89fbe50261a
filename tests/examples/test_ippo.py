"""The example of a new algorithm, independent PPO: it learns, and its robots are independent."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, load_run_config
from innerattn.learn import Team, Transitions
from innerattn.learn.actor_critic import ActorCritic
from innerattn.learn.divergence import DivergenceError
from innerattn.train import load_policy

TEAM = Team(3, 6, 5)
ENVS, STEPS = 8, 4
TRAIN = {
    "train.env-steps": 80_000,
    "train.num-envs": 128,
    "train.threads": 1,
    "train.log-every-env-steps": 8_000,
    "network.hidden-width": 32,
    "ippo.learning-rate": 0.005,
    "ippo.minibatch-size": 800,
    "evaluate.episodes": 2,
    "evaluate.score-episodes": 2,
    "evaluate.long-episodes": 2,
}


@pytest.fixture
def ippo(imported: Callable[[str], ModuleType]) -> ModuleType:
    return imported("ippo")


def make(ippo: ModuleType) -> ActorCritic:
    from ippo.learner import IPPO

    config = ippo.IPPOConfig(rollout_steps=STEPS, epochs=2, minibatch_size=16)
    network = NetworkConfig(hidden_width=16, attention_heads=2)
    return IPPO(TEAM, network, config, seed=1, device=torch.device("cpu"))


def transitions(seed: int, changed: int | None = None) -> tuple[Transitions, Tensor]:
    """Random steps; what robot ``changed`` sees, does and gets is drawn anew."""
    source = torch.Generator().manual_seed(seed)

    def draw() -> list[Tensor]:
        return [
            torch.randn(ENVS, TEAM.num_robots, TEAM.obs_width, generator=source),
            torch.randint(TEAM.num_actions, (ENVS, TEAM.num_robots), generator=source),
            torch.randn(ENVS, TEAM.num_robots, generator=source),
            torch.randn(ENVS, TEAM.num_robots, TEAM.obs_width, generator=source),
        ]

    parts, others = draw(), draw()
    if changed is not None:
        for part, other in zip(parts, others, strict=True):
            part[:, changed] = other[:, changed]
    ended = torch.arange(ENVS) % 5 == 0
    return Transitions(*parts, ended), ~ended & (torch.arange(ENVS) % 3 == 0)


def trained(learner: ActorCritic, changed: int | None = None) -> dict[str, Tensor]:
    for step in range(2 * STEPS):
        learner.observe(*transitions(step, changed))
        metrics = learner.learn()
        assert (metrics is None) == ((step + 1) % STEPS != 0)
    return learner.state()


def test_a_robot_learns_from_nothing_but_its_own_steps(ippo: ModuleType) -> None:
    plain, other = trained(make(ippo)), trained(make(ippo), changed=1)
    before = make(ippo).state()
    weights = [name for name in plain if name.startswith(("actor.", "critic."))]
    assert len(weights) == 12
    for name in weights:
        for robot in range(TEAM.num_robots):
            assert not torch.equal(plain[name][robot], before[name][robot])
            alike = torch.equal(plain[name][robot], other[name][robot])
            assert alike == (robot != 1), (name, robot)


@pytest.mark.long
def test_a_compiled_update_agrees(ippo: ModuleType) -> None:
    torch.compiler.reset()
    compiled = make(ippo)
    compiled.compile("aot_eager")
    found = trained(compiled)
    for name, tensor in trained(make(ippo)).items():
        torch.testing.assert_close(found[name], tensor, rtol=1e-4, atol=1e-5)


def test_updates_that_are_not_finite_are_left_out_where_asked_for(ippo: ModuleType) -> None:
    learner = make(ippo)
    before = trained(learner)
    for skips in (False, True):
        learner.skips_divergence = skips
        for step in range(STEPS):
            batch, truncated = transitions(step)
            batch.obs[:] = torch.inf
            learner.observe(batch, truncated)
        if skips:
            assert learner.learn() == {"skipped_updates": 4.0}
        else:
            with pytest.raises(DivergenceError, match=r"losses\.critic_loss = nan"):
                learner.learn()
        after = learner.state()
        weights = [name for name in before if not name.startswith("scale.")]
        assert all(torch.equal(before[name], after[name]) for name in weights)


@pytest.mark.long
def test_it_learns_to_rescue_from_the_command_line(
    run_installed: Callable[..., subprocess.CompletedProcess[str]],
    tmp_path: Path,
    ippo: ModuleType,
) -> None:
    """An untrained team rescues in less than one of ten episodes, a trained one in every one."""
    options = [text for key, value in TRAIN.items() for text in (f"--{key}", str(value))]
    command = ["train", "--method", "ippo", "--preset", "single", "--run-dir", "run"]
    run_installed("ippo", *command, *options)
    run = tmp_path / "run"
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    rescues = [line["rescues_per_episode"] for line in lines]
    assert rescues[0] < 0.1
    assert rescues[-1] > 1.0
    assert set(lines[-1]["losses"]) == {
        *("critic_loss", "value_mean", "actor_loss", "policy_entropy", "clip_share")
    }
    config, learner = load_policy(run)
    assert config.algorithm == ippo.IPPOConfig(learning_rate=0.005, minibatch_size=800)
    assert learner.updates == lines[-1]["updates"] > 0
    assert config.digest() != load_run_config("single").digest()
