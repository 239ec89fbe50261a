"""Gymnasium's interface of one world: its checks, its registration, and agreement with a batch."""

import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from worlds import CROWDED

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, RescueEnv
from innerattn.errors import ConfigError

ID = "innerattn/Rescue-v0"
FAULTY = Scenario.preset("mixed-faults").replace(observe_faults=True)


@pytest.mark.parametrize("form", ["joint", "agents"])
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
@pytest.mark.parametrize("scenario", ["double", FAULTY])
def test_gymnasium_finds_nothing_wrong(form: str, actions: str, scenario: Any) -> None:
    env = gymnasium.make(ID, scenario=scenario, form=form, actions=actions)
    check_env(env.unwrapped)


@pytest.mark.parametrize(
    "code",
    [
        "import gymnasium, innerattn",
        "import innerattn, gymnasium",
        "import innerattn.envs, importlib.util; importlib.util.find_spec('gymnasium'); "
        "import gymnasium",
        "from innerattn.envs import RescueVectorEnv; import gymnasium",
    ],
)
def test_the_name_is_known_whoever_is_imported_first(code: str) -> None:
    code += f"; print(gymnasium.make({ID!r}).spec.id, gymnasium.make_vec({ID!r}, num_envs=2))"
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == f"{ID} RescueVectorEnv({ID}, num_envs=2)\n", done.stderr


def test_gymnasium_imports_it_by_name() -> None:
    code = f"import gymnasium; print(gymnasium.make('innerattn:{ID}').unwrapped)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "RescueEnv" in done.stdout


@pytest.mark.parametrize("form", ["joint", "agents"])
def test_agrees_with_a_batch_of_one_world(form: str) -> None:
    env = RescueEnv(CROWDED, form=form, seed=5)  # type: ignore[arg-type]
    batch = BatchEnv(CROWDED, 1, 5, autoreset="disabled")
    names = batch.robot_names
    chance = np.random.default_rng(0)
    ended = rescues = 0
    for _ in range(4):
        obs, info = env.reset()
        assert info == {}
        wanted, over = batch.reset()[0], False
        while not over:
            found = obs if form == "joint" else np.stack([obs[name] for name in names])
            np.testing.assert_array_equal(found, wanted)
            np.testing.assert_array_equal(env.state(), batch.state()[0])
            row = chance.integers(5, size=4)
            obs, reward, terminated, truncated, info = env.step(
                row if form == "joint" else dict(zip(names, row, strict=True))
            )
            step = batch.step(row[None])
            wanted, over = step.obs[0], bool(step.terminated[0] or step.truncated[0])
            assert (terminated, truncated) == (step.terminated[0], step.truncated[0])
            assert reward == step.reward.astype(float).sum()
            np.testing.assert_array_equal(info["robot_rewards"], step.reward[0])
            assert info["rescues"] == len(step.rescues)
            ended, rescues = ended + over, rescues + info["rescues"]
        with pytest.raises(ResetNeeded):
            env.step(env.action_space.sample())
    assert ended == 4
    assert rescues > 4


def test_spaces_of_both_forms() -> None:
    joint, agents = RescueEnv(), RescueEnv(form="agents")
    assert joint.action_space == spaces.MultiDiscrete([5] * 4)
    assert joint.observation_space.shape == (4, 44)
    assert isinstance(agents.action_space, spaces.Dict)
    assert agents.action_space["medical_0"] == spaces.Discrete(5)
    assert agents.observation_space["food_1"].shape == (44,)
    assert RescueEnv(actions="continuous").action_space.shape == (4, 2)


@pytest.mark.parametrize(
    ("form", "action", "error", "message"),
    [
        ("joint", [0, 0, 0, 5], ValueError, r"robot 3\] = 5"),
        ("joint", [0, 0, 0], ValueError, r"actions has shape \(1, 3\)"),
        ("joint", [0.5] * 4, TypeError, "actions .* integers"),
        ("agents", [0, 0, 0, 0], TypeError, "actions is a list: must be a dict by robot"),
        ("agents", {"food_0": 0}, ValueError, "differs in .*food_1"),
        ("agents", {name: [0] for name in ("food_0", "food_1", "navigation_0", "medical_0")},
         ValueError, r"actions has shape \(1, 4, 1\)"),
    ],
)  # fmt: skip
def test_wrong_actions_change_nothing(
    form: Any, action: Any, error: type[Exception], message: str
) -> None:
    env = RescueEnv(form=form, seed=0)
    env.reset()
    before = env.state()
    with pytest.raises(error, match=message):
        env.step(action)
    np.testing.assert_array_equal(env.state(), before)


def test_arguments_are_checked() -> None:
    with pytest.raises(ConfigError, match="form = 'both': must be 'joint' or 'agents'"):
        RescueEnv(form="both")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="max_episode_steps and episode_steps are the same"):
        RescueEnv(max_episode_steps=3, episode_steps=4)
    with pytest.raises(ConfigError, match="render_mode = 'ansi'"):
        RescueEnv(render_mode="ansi")
    with pytest.raises(ConfigError, match="unknown key"):
        RescueEnv(colour=1)
    with pytest.raises(ResetNeeded):
        RescueEnv().step([0, 0, 0, 0])
