"""The PettingZoo interface: PettingZoo's own checks, and agreement with a batch of one world."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from pettingzoo.test import parallel_api_test, parallel_seed_test

from innerattn.config import Obstacle, Robot, Scenario
from innerattn.envs import BatchEnv, parallel_env
from innerattn.errors import ConfigError

CROWDED = Scenario(
    situation="double",
    obstacles=(
        Obstacle(shape="disc", radius_m=0.08),
        Obstacle(shape="box", half_extents_m=(0.1, 0.05), position_m=(0.4, 0.4)),
    ),
)
STAY = {"food_0": 0, "food_1": 0, "navigation_0": 0, "medical_0": 0}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("scenario", ["single", "double", "mixed", CROWDED])
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_pettingzoo_api(scenario: Scenario | str, actions: str) -> None:
    parallel_api_test(parallel_env(scenario, actions=actions), num_cycles=60)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_pettingzoo_seed(actions: str) -> None:
    parallel_seed_test(lambda: parallel_env("double", actions=actions), num_cycles=60)


def test_spaces_and_metadata() -> None:
    env = parallel_env()
    assert env.metadata["name"] == str(env) == "innerattn_v0"
    assert env.metadata["render_modes"] == ["human", "rgb_array"]
    assert env.metadata["is_parallelizable"]
    assert env.possible_agents == ["food_0", "food_1", "navigation_0", "medical_0"]
    obs, infos = env.reset(seed=1)
    assert infos == {agent: {} for agent in env.agents}
    for agent in env.possible_agents:
        assert env.action_space(agent) == spaces.Discrete(5)
        assert env.action_space(agent) is not env.action_space("food_0") or agent == "food_0"
        assert env.observation_space(agent).contains(obs[agent])
    continuous = parallel_env(actions="continuous").action_space("food_0")
    assert continuous == spaces.Box(-1.0, 1.0, (2,), np.float32)


def test_agrees_with_a_batch_of_one_world() -> None:
    env, batch = parallel_env("double", seed=5), BatchEnv("double", 1, 5, autoreset="disabled")
    rng = np.random.default_rng(0)
    for _ in range(3):  # the next episodes are the same too
        obs, _ = env.reset()
        np.testing.assert_array_equal(np.stack(list(obs.values())), batch.reset()[0])
        while env.agents:
            row = rng.integers(5, size=4)
            obs, reward, terminated, truncated, infos = env.step(
                dict(zip(env.agents, row, strict=True))
            )
            step = batch.step(row[None])
            np.testing.assert_array_equal(np.stack(list(obs.values())), step.obs[0])
            assert list(reward.values()) == step.reward[0].tolist()
            assert set(terminated.values()) == {bool(step.terminated[0])}
            assert set(truncated.values()) == {bool(step.truncated[0])}
            for info, components in zip(infos.values(), batch.reward_components()[0], strict=True):
                assert list(info["reward_components"].values()) == components.tolist()


def test_seed_decides_the_episodes() -> None:
    def first(seed: int | None) -> list[float]:
        obs, _ = parallel_env(seed=seed).reset()
        return obs["food_0"].tolist()  # type: ignore[no-any-return]

    assert first(3) == first(3) != first(4)
    assert first(None) != first(None)
    env = parallel_env(seed=3)
    env.reset()
    second, _ = env.reset()
    assert second["food_0"].tolist() != first(3)
    again, _ = env.reset(seed=3)
    assert again["food_0"].tolist() == first(3)


def test_wrappers_find_a_generator_that_the_seed_decides() -> None:
    env = parallel_env(seed=1)
    assert env.np_random.integers(2**40) == np.random.default_rng(1).integers(2**40)
    env.reset(seed=5)
    before = env.reset()[0]["food_0"]
    drawn = env.np_random.integers(2**40)
    assert drawn == np.random.default_rng(5).integers(2**40)
    env.reset(seed=5)
    env.np_random.random(3)  # the world draws from streams of its own
    np.testing.assert_array_equal(before, env.reset()[0]["food_0"])


def test_observations_stay_as_they_were() -> None:
    env = parallel_env(seed=0)
    obs, _ = env.reset()
    kept = {agent: row.copy() for agent, row in obs.items()}
    for _ in range(4):
        env.step(STAY | {"food_0": 1})
    for agent, row in obs.items():
        np.testing.assert_array_equal(row, kept[agent])


def test_episode_ends_for_all_at_once() -> None:
    env = parallel_env(max_cycles=3)
    env.reset(seed=0)
    for last in (False, False, True):
        *_, terminated, truncated, _ = env.step(STAY)
        assert set(truncated.values()) == {last}
        assert set(terminated.values()) == {False}
    assert env.agents == []
    with pytest.raises(ResetNeeded, match="reset"):
        env.step({})
    env.reset()
    assert env.agents == env.possible_agents


def together(distance: float) -> Scenario:
    """Two robots that reach everything at once: every victim is rescued in the first step."""
    scenario = Scenario.preset("single")
    pair = [
        Robot(
            name=f"all_{i}",
            kind="all",
            abilities=("food", "medicine", "information"),
            max_speed_mps=1.0,
            mass_kg=1.0,
        )
        for i in range(2)
    ]
    return scenario.replace(robots=pair, rescue_radius_m=distance, spawn_clearance_m=0.0)


def test_rescues_and_termination() -> None:
    env = parallel_env(together(3.0), end_when_rescued=2)
    env.reset(seed=0)
    stay = {"all_0": 0, "all_1": 0}
    _, reward, terminated, _, infos = env.step(stay)
    assert [info["rescues"] for info in infos.values()] == [1, 1]
    assert [info["reward_components"]["rescue"] for info in infos.values()] == [1.0, 1.0]
    assert reward["all_0"] == pytest.approx(sum(infos["all_0"]["reward_components"].values()))
    assert not any(terminated.values())
    *_, terminated, _, _ = env.step(stay)
    assert all(terminated.values())
    assert env.agents == []


def test_losses() -> None:
    plain = Scenario.preset("double")
    mortal = plain.replace(tasks=tuple(task.replace(deadline_s=0.2) for task in plain.tasks))
    env = parallel_env(mortal)
    env.reset(seed=0)
    stay = dict.fromkeys(env.agents, 0)
    lost = [{info["lost"] for info in env.step(stay)[-1].values()} for _ in range(4)]
    assert lost == [{0}, {2}, {0}, {2}]
    endless = parallel_env(plain)
    endless.reset(seed=0)
    assert not any("lost" in info for info in endless.step(stay)[-1].values())


def test_victims_that_are_turned_away() -> None:
    plain = Scenario.preset("mixed")
    tasks = tuple(task.replace(arrival_rate_hz=6.0) for task in plain.tasks)
    worlds = plain.replace(situation="poisson", max_victims=1, tasks=tasks)
    env, batch = parallel_env(worlds, seed=2), BatchEnv(worlds, 1, 2, autoreset="disabled")
    env.reset(seed=2)
    batch.reset(seed=2)
    stay, found = dict.fromkeys(env.agents, 0), []
    for _ in range(9):
        told = {info["turned_away"] for info in env.step(stay)[-1].values()}
        batch.step(np.zeros((1, 4), np.int64))
        found.append(int(batch.turned_away()[0]))
        assert told == {found[-1]}
    assert sum(found) > 2
    other = parallel_env(plain)
    other.reset(seed=0)
    assert not any("turned_away" in info for info in other.step(stay)[-1].values())


@pytest.mark.parametrize("scenario", [CROWDED, Scenario.preset("mixed")])
def test_state_is_the_world(scenario: Scenario) -> None:
    env, batch = parallel_env(scenario, seed=2), BatchEnv(scenario, 1, 2, autoreset="disabled")
    with pytest.raises(ResetNeeded, match="reset"):
        env.state()
    env.reset()
    batch.reset()
    for row in ([1, 2, 3, 4], [3, 3, 0, 1]):
        env.step(dict(zip(env.agents, row, strict=True)))
        batch.step(np.array([row]))
    expected: list[float] = []
    for place, velocity in zip(batch.positions()[0], batch.velocities()[0], strict=True):
        expected += [*place, *velocity]
    for victim in batch.victims()[0]:
        here = bool(victim["present"])
        expected += [float(here and victim["task"] == task) for task in range(2)]
        expected += [victim["x"] * here, victim["y"] * here]
    for obstacle in batch.obstacles()[0]:
        expected += [*obstacle]
    state = env.state()
    assert env.state_space.contains(state)
    np.testing.assert_array_equal(state, np.array(expected, np.float32))


@pytest.mark.parametrize(
    ("actions", "error", "message"),
    [
        ({"food_0": 0}, ValueError, "food_1"),
        (STAY | {"food_2": 0}, ValueError, "food_2"),
        (STAY | {"medical_0": 5}, ValueError, "robot 3|medical_0"),
        (STAY | {"medical_0": 0.5}, TypeError, r"actions\['medical_0'\] = 0.5: must be an integer"),
        (STAY | {"medical_0": True}, TypeError, "medical_0"),
        (STAY | {"medical_0": "1"}, TypeError, "medical_0"),
        (STAY | {"medical_0": [1]}, ValueError, r"actions\['medical_0'\] has shape \(1,\)"),
        ([0, 0, 0, 0], TypeError, "actions is a list: must be a dict"),
    ],
)
def test_wrong_actions_change_nothing(
    actions: dict[str, Any], error: type[Exception], message: str
) -> None:
    env = parallel_env(seed=0)
    env.reset()
    before = env.state()
    with pytest.raises(error, match=message):
        env.step(actions)
    np.testing.assert_array_equal(env.state(), before)


@pytest.mark.parametrize(
    ("action", "error", "message"),
    [
        (["0", "1"], TypeError, "must be two numbers"),
        ([1j, 0], TypeError, "must be two numbers"),
        ([True, False], TypeError, "must be two numbers"),
        ([0.5], ValueError, r"actions\['food_1'\] has shape \(1,\): must be \(2,\)"),
        ([0.5, 2.0], ValueError, "robot 1"),
    ],
)
def test_wrong_forces_change_nothing(
    action: list[Any], error: type[Exception], message: str
) -> None:
    env = parallel_env(seed=0, actions="continuous")
    env.reset()
    before = env.state()
    with pytest.raises(error, match=message):
        env.step({key: [0.0, 0.0] for key in STAY} | {"food_1": action})
    np.testing.assert_array_equal(env.state(), before)


def test_integers_of_all_widths_are_actions() -> None:
    env = parallel_env(seed=0)
    env.reset()
    env.step(STAY | {"food_0": np.uint64(2), "food_1": np.array(3, np.int8)})


def test_arguments_are_checked() -> None:
    with pytest.raises(ConfigError, match=r"scenario\.colour: unknown key"):
        parallel_env(colour=1)
    with pytest.raises(ConfigError, match=r"render_mode = 'ansi'"):
        parallel_env(render_mode="ansi")
    with pytest.raises(ConfigError, match="max_cycles and episode_steps"):
        parallel_env(max_cycles=3, episode_steps=4)
    with pytest.raises(ConfigError, match=r"scenario\.episode_steps = 0"):
        parallel_env(max_cycles=0)
    with pytest.raises(ConfigError, match="'triple'"):
        parallel_env("triple")


def test_length_is_the_scenarios_unless_given() -> None:
    long = Scenario(episode_steps=100)
    assert parallel_env().max_cycles == 25
    assert parallel_env(long).max_cycles == 100
    assert parallel_env(long, max_cycles=7).max_cycles == 7


def test_import_needs_no_torch_and_no_plots() -> None:
    code = (
        "import sys, innerattn.envs; from innerattn.envs import parallel_env; "
        "print([m for m in ('torch', 'matplotlib', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
