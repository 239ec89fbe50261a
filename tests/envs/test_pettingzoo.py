"""PettingZoo's own checks of both of its interfaces, and what they refuse."""

from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
    seed_test,
)
from pettingzoo.test.state_test import state_test
from pettingzoo.utils.conversions import aec_to_parallel
from worlds import CROWDED

import innerattn.envs
from innerattn.config import Scenario
from innerattn.envs import env, parallel_env

LONG = 400
FAULTY = Scenario.preset("mixed-faults").replace(observe_faults=True)


@pytest.mark.parametrize("scenario", ["single", "double", "mixed-8", CROWDED, FAULTY])
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_api(scenario: Scenario | str, actions: str) -> None:
    parallel_api_test(parallel_env(scenario, actions=actions), num_cycles=60)
    api_test(env(scenario, actions=actions), num_cycles=60)
    state_test(env(scenario, actions=actions), parallel_env(scenario, actions=actions))


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_long_episodes_of_one_seed_are_the_same(actions: str) -> None:
    options: dict[str, Any] = {"max_cycles": LONG, "actions": actions}
    parallel_seed_test(lambda: parallel_env(CROWDED, **options), num_cycles=LONG)
    seed_test(lambda: env(CROWDED, **options), num_cycles=LONG)


def test_length_and_pictures() -> None:
    max_cycles_test(innerattn.envs)
    render_test(lambda render_mode: env("double", render_mode=render_mode))


def test_all_robots_have_equal_spaces_of_their_own() -> None:
    world = parallel_env(FAULTY)
    spaces = [world.observation_space(agent) for agent in world.possible_agents]
    assert all(space == spaces[0] for space in spaces)
    assert len({id(space) for space in spaces}) == len(spaces)
    assert np.isfinite(spaces[0].high).all()
    assert np.isfinite(world.state_space.high).all()


def test_what_needs_a_reset_is_refused_before_it() -> None:
    world, turns = parallel_env(), env()
    for refused in (lambda: world.step({}), world.state):
        with pytest.raises(ResetNeeded, match="reset"):
            refused()
    for refused in (lambda: turns.step(0), turns.state, turns.agent_iter, turns.last):
        with pytest.raises((AssertionError, AttributeError), match="reset"):
            refused()


@pytest.mark.parametrize(("action", "error"), [(5, ValueError), (-1, ValueError), (0.5, TypeError)])
def test_a_wrong_action_leaves_the_turn_where_it_is(action: Any, error: type[Exception]) -> None:
    turns, wanted = env(seed=1), env(seed=1)
    for world in (turns, wanted):
        world.reset()
        world.step(1)
    with pytest.raises(error, match=r"actions\['food_1'\]"):
        turns.step(action)
    assert turns.agent_selection == "food_1"
    for world in (turns, wanted):
        for _ in range(3):
            world.step(2)
    np.testing.assert_array_equal(turns.state(), wanted.state())


def test_in_turn_and_all_at_once_are_the_same_world() -> None:
    turns, world = env(CROWDED, seed=4), parallel_env(CROWDED, seed=4)
    turns.reset()
    world.reset()
    chance = np.random.default_rng(0)
    while world.agents:
        actions = {agent: int(chance.integers(5)) for agent in world.agents}
        obs, rewards, terminated, truncated, _ = world.step(actions)
        for agent in actions:
            assert turns.agent_selection == agent
            turns.step(actions[agent])
        for agent in actions:
            np.testing.assert_array_equal(turns.observe(agent), obs[agent])
        assert turns.rewards == rewards
        assert (turns.terminations, turns.truncations) == (terminated, truncated)
    while turns.agents:
        turns.step(None)
    assert aec_to_parallel(env()).possible_agents == world.possible_agents
