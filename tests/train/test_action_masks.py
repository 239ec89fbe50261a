"""Robots that cannot act stay for certain, whatever their policies are made of."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from innerattn.config import RunConfig, load_run_config
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, ExportError
from innerattn.nn import Actor, MaskedActor
from innerattn.report.page.team import read_team
from innerattn.train import load_policy, train
from innerattn.train.export import export_run

Configure = Callable[..., RunConfig]
MASKED = {
    "network.mask_actions": True,
    "scenario.faults": [
        {
            "robot": robot,
            "kind": "unavailable",
            "value": 1.0,
            "onset_rate_hz": 1.0,
            "duration_steps": 4,
        }
        for robot in ("food_0", "medical_0")
    ],
}
KINDS: dict[str, dict[str, Any]] = {
    "td-inner": {"train.method": "td-inner"},
    "ppo-inner canonical": {"train.method": "ppo-inner", "network.symmetry": "canonical"},
    "mappo memory messages": {
        "train.method": "mappo",
        "network.memory_width": 4,
        "network.message_width": 4,
    },
}


def test_logits_beside_plain_loops() -> None:
    sizes = 3, 6, 5, 8
    plain = Actor(*sizes, torch.Generator().manual_seed(1))
    masked = MaskedActor(*sizes, torch.Generator().manual_seed(1))
    masked.able = (2, 4)
    obs = torch.randn(3, 7, 6, generator=torch.Generator().manual_seed(2))
    wanted, found = plain(obs), masked(obs)
    unable = 0
    for robot in range(3):
        for row in range(7):
            able = obs[robot, row, 2] > 0 and obs[robot, row, 4] > 0
            unable += not able
            chance = found[robot, :, row].softmax(0)
            expected = wanted[robot, :, row].softmax(0) if able else torch.eye(5)[0]
            torch.testing.assert_close(chance, expected)
    assert 5 < unable < 20
    (found.log_softmax(1).exp() * found.log_softmax(1)).sum().backward()
    assert all(one.grad.isfinite().all() for one in masked.parameters())


@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_that_cannot_act_stays(kind: str, small_config: Configure, tmp_path: Path) -> None:
    config = small_config(**{**MASKED, **KINDS[kind]})
    train(config, tmp_path / "run")
    config, learner = load_policy(tmp_path / "run")
    assert config.network.mask_actions
    assert all(one.isfinite().all() for one in learner.state().values())
    able, stays = [], []
    with BatchEnv(config.scenario, 32, seed=5, num_threads=1) as env:
        obs = env.reset()
        for _ in range(config.scenario.episode_steps - 1):
            actions = learner.act(torch.from_numpy(np.array(obs))).numpy()
            able.append(env.action_mask()[:, :, 1:].any(-1))
            stays.append(actions == 0)
            obs = env.step(actions).obs
    able, stays = np.array(able), np.array(stays)
    assert 100 < (~able).sum() < able.sum()
    assert stays[~able].all()
    assert stays[able].mean() < 0.6


def test_without_a_fault_a_mask_changes_nothing(small_config: Configure, tmp_path: Path) -> None:
    found = []
    for masked in (False, True):
        run = tmp_path / str(masked)
        train(small_config(**{"train.method": "ppo-inner", "network.mask_actions": masked}), run)
        found.append(load_policy(run)[1].state())
    assert all(torch.equal(one, found[1][name]) for name, one in found[0].items())


def test_pages_take_such_a_team_and_exports_do_not(small_config: Configure, tmp_path: Path) -> None:
    train(small_config(**{**MASKED, "train.method": "ppo-inner"}), tmp_path / "run")
    with pytest.raises(ExportError, match="its policy is a MaskedActor: must be an innerattn"):
        export_run(tmp_path / "run", tmp_path / "export")
    assert read_team(tmp_path / "run").config.network.mask_actions


@pytest.mark.parametrize(
    ("method", "values", "message"),
    [
        ("team-inner", {}, "network.mask_actions = true: train.method = 'team-inner' has no masks"),
        ("ppo-inner", {"scenario.actions": "continuous"}, "scenario.actions must be 'discrete'"),
        (
            "ppo-inner",
            {"train.warm_start": "hungarian"},
            "network.mask_actions = true: train.warm_start = 'hungarian' imitates robots that",
        ),
    ],
)
def test_what_masks_do_not_go_with(method: str, values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        load_run_config(method=method, overrides={"network.mask_actions": True, **values})
