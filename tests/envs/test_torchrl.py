"""TorchRL's interface: its own check, agreement with a batch, and its collector and replay."""

import copy
import pickle
import warnings
from typing import Any

import numpy as np
import pytest
import torch
from worlds import CROWDED

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, RescueTorchRLEnv
from innerattn.errors import ConfigError

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # TorchRL's, of its own parts
    torchrl = pytest.importorskip("torchrl")
    from torchrl import collectors
    from torchrl.data import LazyTensorStorage, ReplayBuffer
    from torchrl.envs.utils import check_env_specs, check_marl_grouping

ENVS = 5
UNEVEN = CROWDED.replace(episode_steps=11, end_when_rescued=1)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
@pytest.mark.parametrize("scenario", ["mixed", "mixed-8", CROWDED])
def test_torchrl_finds_nothing_wrong(scenario: Any, actions: str) -> None:
    env = RescueTorchRLEnv(scenario, ENVS, actions=actions)
    check_env_specs(env, seed=0)
    check_marl_grouping(env.group_map, [robot.name for robot in env.scenario.robots])


def test_robots_of_a_kind_are_a_group() -> None:
    env = RescueTorchRLEnv("mixed", ENVS)
    assert env.group_map == {
        "food": ["food_0", "food_1"],
        "navigation": ["navigation_0"],
        "medical": ["medical_0"],
    }
    first = env.reset()
    assert first["food", "observation"].shape == (ENVS, 2, 44)
    assert first["state"].shape == (ENVS, 24)
    assert env.full_action_spec["food", "action"].shape == (ENVS, 2)
    assert env.full_reward_spec["medical", "reward"].shape == (ENVS, 1, 1)


def test_a_rollout_is_that_of_a_batch() -> None:
    env = RescueTorchRLEnv(UNEVEN, ENVS, seed=1)
    batch = BatchEnv(UNEVEN, ENVS, seed=7)
    kinds = {"food": [0, 1], "navigation": [2], "medical": [3]}
    env.set_seed(7)
    steps = env.rollout(60, break_when_any_done=False)
    obs = batch.reset()
    ended = uneven = 0
    for now in steps.unbind(1):
        actions = np.empty((ENVS, 4), int)
        np.testing.assert_array_equal(now["state"].numpy(), batch.state())
        for kind, robots in kinds.items():
            np.testing.assert_array_equal(now[kind, "observation"].numpy(), obs[:, robots])
            actions[:, robots] = now[kind, "action"].numpy()
        step = batch.step(actions)
        after = now["next"]
        for kind, robots in kinds.items():
            seen, reward = after[kind, "observation"].numpy(), after[kind, "reward"][..., 0].numpy()
            np.testing.assert_array_equal(seen, step.final_obs[:, robots])
            np.testing.assert_array_equal(reward, step.reward[:, robots])
        over = step.terminated | step.truncated
        for name, flags in (("terminated", step.terminated), ("truncated", step.truncated)):
            np.testing.assert_array_equal(after[name][:, 0].numpy(), flags)
        np.testing.assert_array_equal(after["done"][:, 0].numpy(), over)
        ended, uneven = ended + over.sum(), uneven + (over.any() and not over.all())
        obs = step.obs
    assert ended > 20
    assert uneven > 5


def test_each_world_takes_a_seed_once() -> None:
    env, batch = RescueTorchRLEnv(UNEVEN, ENVS, seed=1), BatchEnv(UNEVEN, ENVS, seed=7)
    now = env.reset()
    env.set_seed(7)  # after the first reset, as collectors do
    found: list[list[torch.Tensor]] = [[] for _ in range(ENVS)]
    for _ in range(100):
        before, now = env.step_and_maybe_reset(env.rand_action(now))
        for world in np.flatnonzero(before["next", "done"][:, 0].numpy()):
            found[world].append(now["state"][world])
    assert len({len(starts) for starts in found}) > 1  # worlds ended at different times
    for episode in range(max(map(len, found))):
        batch.reset()
        for world, starts in enumerate(found):
            if episode < len(starts):
                np.testing.assert_array_equal(starts[episode].numpy(), batch.state()[world])


def test_collector_and_replay() -> None:
    name = "Collector" if hasattr(collectors, "Collector") else "SyncDataCollector"
    collector = getattr(collectors, name)(
        lambda: RescueTorchRLEnv(UNEVEN, ENVS), None, frames_per_batch=50, total_frames=150
    )
    replay = ReplayBuffer(storage=LazyTensorStorage(200), batch_size=32)
    for frames in collector:
        replay.extend(frames.reshape(-1))
    collector.shutdown()
    assert len(replay) == 150
    sample = replay.sample()
    assert sample["next", "food", "reward"].shape == (32, 2, 1)
    assert torch.isfinite(sample["food", "observation"]).all()


def test_copies_go_on() -> None:
    env = RescueTorchRLEnv("mixed-faults", ENVS, seed=3)
    env.rollout(5)
    actions = env.rand_action(env.reset())
    wanted = env.step(actions.clone())["next"]
    env.set_seed(5)
    env.reset()
    for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert torch.equal(other.state(), env.state())
        found = other.step(actions.clone())["next"]
        assert found["state"].shape == wanted["state"].shape
    env.close()
    with pytest.raises(RuntimeError, match="closed"):
        env.state()


def test_arguments_are_checked() -> None:
    with pytest.raises(ConfigError, match="max_steps and episode_steps are the same"):
        RescueTorchRLEnv(max_steps=3, episode_steps=4)
    with pytest.raises(ValueError, match="num_envs = 0"):
        RescueTorchRLEnv(num_envs=0)
    env = RescueTorchRLEnv(Scenario(), 2)
    with pytest.raises(ValueError, match="seed = -1"):
        env.set_seed(-1)
