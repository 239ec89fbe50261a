"""The script of limited knowledge: what it uses, how it searches, what it is worth."""

import numpy as np
import pytest

from innerattn.config import Communication, Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import WorldState, scripted_policy, scripts_of
from innerattn.policies.policy import PolicyInput
from innerattn.policies.scripted.dispatch import GreedyPolicy, GreedySeenPolicy
from innerattn.policies.scripted.sweeping import Sweep

ENVS = 64


def sighted(sight_m: float | None, **values: object) -> Scenario:
    plain = Scenario().replace(**values)
    robots = tuple(robot.replace(sight_m=sight_m) for robot in plain.robots)
    return plain.replace(robots=robots)


def walked(scenario: Scenario, steps: int) -> BatchEnv:
    env = BatchEnv(scenario, ENVS, seed=5, num_threads=1)
    env.reset()
    rng = np.random.default_rng(1)
    for _ in range(steps):
        env.step(rng.integers(0, 5, (ENVS, scenario.num_robots)))
    return env


def places_of(state: WorldState) -> np.ndarray:
    return np.stack([state.victims["x"], state.victims["y"]], -1).astype(np.float64)


def test_who_sees_everything_goes_where_greedy_goes() -> None:
    for sight_m in (None, 9.0):
        scenario = sighted(sight_m)
        state = WorldState.of(walked(scenario, 7))
        assert (state.last_seen is None) == (sight_m is None)
        seen, greedy = GreedySeenPolicy(scenario), GreedyPolicy(scenario)
        chosen = seen.choose(state, places_of(state))
        np.testing.assert_array_equal(chosen, greedy.choose(state, places_of(state)))
        assert (chosen >= 0).any()


def test_nobody_goes_to_a_victim_it_never_saw_nor_minds_what_it_does_not_see() -> None:
    scenario = sighted(0.5)
    env = walked(scenario, 12)
    policy = scripted_policy("greedy-seen", scenario)
    state = WorldState.of(env)
    assert state.last_seen is not None
    chosen = policy.choose(state, places_of(state))  # type: ignore[attr-defined]
    known = state.last_seen[:, :, 4:] >= 0
    goes = chosen >= 0
    assert np.take_along_axis(known, np.maximum(chosen, 0)[..., None], 2)[..., 0][goes].all()
    assert goes.any()
    assert not goes.all()
    before = policy.act(PolicyInput(env.observe(), state))
    for own in range(4):
        victims, positions = state.victims.copy(), state.positions.copy()
        unknown = victims["present"] & ~known[:, own]
        for axis in ("x", "y"):
            victims[axis] = np.where(unknown, 0.123, victims[axis])
        victims["task"] = np.where(unknown, 1 - victims["task"], victims["task"])
        positions[:, [other for other in range(4) if other != own]] = 0.4
        other = state._replace(victims=victims, positions=positions)
        np.testing.assert_array_equal(
            policy.act(PolicyInput(env.observe(), other))[:, own], before[:, own]
        )
        assert unknown.any()


@pytest.mark.parametrize("sight_m", [0.15, 0.4, 0.7, 3.0])
def test_lanes_pass_every_place_within_sight(sight_m: float) -> None:
    sweep = Sweep(sighted(sight_m), np.full(4, 0.5))
    places = sweep.places(np.arange(3_000))
    grid = np.stack(np.meshgrid(*[np.linspace(-0.99, 0.99, 25)] * 2), -1).reshape(-1, 1, 2)
    for robot in range(4):
        nearest = np.linalg.norm(grid - places[:, robot], axis=-1).min(1)
        assert nearest.max() <= sight_m
    steps = np.linalg.norm(np.diff(places, axis=0), axis=-1)
    assert steps.max() <= 0.8 * 0.5 * 0.1 + 1e-9
    assert len(np.unique(places[0].round(6), axis=0)) == 4, "they begin at different places"


def test_it_is_measured_where_sight_is_limited_and_is_between_chance_and_all_knowing() -> None:
    limited = sighted(0.6, episode_steps=50)
    assert scripts_of(Scenario()) == ("random", "greedy", "hungarian")
    assert scripts_of(limited) == ("random", "greedy", "hungarian", "greedy-seen")
    rescues = {
        name: run_episodes(scripted_policy(name, limited), limited, 60, 3).rescue_counts().mean()
        for name in ("random", "greedy-seen", "hungarian")
    }
    assert 3 * rescues["random"] < rescues["greedy-seen"] < rescues["hungarian"]


def test_who_is_told_of_victims_goes_to_them() -> None:
    """With what it was told it rescues more than without, and no more than one that sees all."""
    alone = sighted(0.5, episode_steps=40)
    told = alone.replace(communication=Communication(share="victims"))
    alone_mean, told_mean, all_mean = (
        run_episodes(scripted_policy(name, scenario), scenario, 100, 3).rescue_counts().mean()
        for name, scenario in (("greedy-seen", alone), ("greedy-seen", told), ("greedy", told))
    )
    assert 1.1 * alone_mean < told_mean <= 1.05 * all_mean
