"""Batteries as Python sees them: charges, observations, states, and what cannot bear them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config import Battery, Scenario, Station
from innerattn.envs import BatchEnv, parallel_env
from innerattn.envs.bounds import observation_bounds, state_bounds
from innerattn.errors import ConfigError

ENVS = 3


def powered(capacity_j: float = 10.0, **changed: object) -> Scenario:
    """The usual team; all but the first robot have a battery, and there are two stations."""
    first, *others = Scenario().robots
    battery = Battery(capacity_j=capacity_j, per_m_j=4.0, idle_w=2.0)
    stations = tuple(
        Station(position_m=at, radius_m=0.3, recharge_w=30.0) for at in ((-0.5, 0.0), (0.5, 0.5))
    )
    robots = (first, *(robot.replace(battery=battery) for robot in others))
    return Scenario().replace(**{"robots": robots, "stations": stations, **changed})


def columns(env: BatchEnv, ending: str) -> list[int]:
    return [i for i, name in enumerate(env.observation_names()) if name.endswith(ending)]


@given(seed=st.integers(0, 2**32), actions=st.sampled_from(["discrete", "continuous"]))
def test_what_is_seen_is_what_there_is(seed: int, actions: str) -> None:
    env = BatchEnv(powered(actions=actions), ENVS, seed=seed, num_threads=1, autoreset="disabled")
    rng = np.random.default_rng(seed)
    obs = env.reset()
    assert (env.charge() == 1.0).all()
    low, high = observation_bounds(env.scenario)
    state_low, state_high = state_bounds(env.scenario)
    shares = [i for i, name in enumerate(env.state_names()) if name.endswith(".charge")]
    assert len(shares) == env.num_robots
    at_stations = np.array([one.position_m for one in env.scenario.stations])
    for _ in range(20):
        charge = env.charge()
        assert charge.dtype == np.float32
        assert (charge[:, 0] == 1.0).all()
        assert (charge >= 0.0).all()
        assert (charge <= 1.0).all()
        assert (obs >= low).all()
        assert (obs <= high).all()
        seen = obs[..., columns(env, ".charge")]
        for robot in range(env.num_robots):
            others = [one for one in range(env.num_robots) if one != robot]
            assert (seen[:, robot] == charge[:, [robot, *others]]).all()
        ways = at_stations - env.positions()[:, :, None]
        nearest = np.linalg.norm(ways, axis=-1).min(-1)
        station = [env.observation_names().index(f"own.station.{axis}") for axis in "xy"]
        np.testing.assert_allclose(np.linalg.norm(obs[..., station], axis=-1), nearest, atol=1e-5)
        state = env.state()
        assert state.shape[1] == len(env.state_names()) == len(state_low)
        assert (state[:, shares] == charge).all()
        assert (state >= state_low).all()
        assert (state <= state_high).all()
        shape = (ENVS, env.num_robots)
        drawn = rng.integers(0, 5, shape)
        if actions == "continuous":
            drawn = rng.uniform(-1, 1, (*shape, 2)).astype(np.float32)
        obs = env.step(drawn).obs


def test_a_copy_goes_on_with_the_same_charges() -> None:
    env = BatchEnv(powered(2.0), ENVS, seed=3)
    env.reset()
    still = np.zeros((ENVS, env.num_robots), int)
    for _ in range(4):
        env.step(still)
    other = BatchEnv(powered(2.0), ENVS, seed=4)
    other.restore(env.snapshot())
    assert (env.charge() < 1.0).any()
    for _ in range(5):
        assert (other.charge() == env.charge()).all()
        one, two = env.step(still), other.step(still)
        assert (one.obs == two.obs).all()
        assert (one.reward == two.reward).all()


def test_columns_are_there_only_where_they_are_needed() -> None:
    plain = BatchEnv("mixed", 1)
    assert not columns(plain, ".charge")
    assert not columns(plain, "station.x")
    assert (plain.charge() == 1.0).all()
    assert plain.charge().shape == (1, 4)
    alone = BatchEnv(powered(stations=()), 1)
    assert len(columns(alone, ".charge")) == 4
    assert not columns(alone, "station.x")


def test_a_blackout_leaves_a_robot_its_own_charge() -> None:
    faults = [{"robot": "food_1", "kind": "blackout", "value": 1.0}]
    env = BatchEnv(powered(faults=faults), 1, seed=1)
    env.reset()
    row = env.step(np.zeros((1, 4), int)).obs[0, 1]
    own, *mates = columns(env, ".charge")
    assert row[own] == env.charge()[0, 1] > 0.0
    assert (row[[*mates, *columns(env, "station.x"), *columns(env, "station.y")]] == 0.0).all()


def test_views_play_with_batteries() -> None:
    env = parallel_env(powered(1.0))
    obs, _ = env.reset(seed=1)
    assert all(env.observation_space(agent).contains(row) for agent, row in obs.items())


def test_policies_for_any_team_see_no_charges() -> None:
    from innerattn.train.teams.sheet import TeamSheet

    scenario = powered()
    with pytest.raises(ConfigError, match=r"robots\[1\].battery.capacity_j = 10: there must be no"):
        TeamSheet(scenario, BatchEnv(scenario, 1).observation_names())
