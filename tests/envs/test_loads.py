"""Loads as Python sees them: shares, observations, states, and what cannot bear them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config import Battery, Depot, Scenario, Station
from innerattn.envs import BatchEnv, parallel_env
from innerattn.envs.bounds import observation_bounds, state_bounds
from innerattn.errors import ConfigError

ENVS = 3


def loaded(load: int = 2, **changed: object) -> Scenario:
    """The usual team; all but the first robot have a load, and there are two depots."""
    first, *others = Scenario().robots
    depots = (Depot(position_m=(-0.5, 0.0)), Depot(position_m=(0.5, 0.5), radius_m=0.2))
    robots = (first, *(robot.replace(load=load) for robot in others))
    values = {"robots": robots, "depots": depots, "rescue_radius_m": 0.5, **changed}
    return Scenario().replace(**values)


def with_batteries(scenario: Scenario) -> Scenario:
    battery = Battery(capacity_j=10.0, per_m_j=4.0)
    robots = tuple(robot.replace(battery=battery) for robot in scenario.robots[:2])
    station = Station(position_m=(0.0, 0.5), recharge_w=5.0)
    return scenario.replace(robots=robots + scenario.robots[2:], stations=(station,))


def columns(env: BatchEnv, ending: str) -> list[int]:
    return [i for i, name in enumerate(env.observation_names()) if name.endswith(ending)]


@given(seed=st.integers(0, 2**32), powered=st.booleans())
def test_what_is_seen_is_what_there_is(seed: int, powered: bool) -> None:
    scenario = with_batteries(loaded()) if powered else loaded()
    env = BatchEnv(scenario, ENVS, seed=seed, num_threads=1, autoreset="disabled")
    rng = np.random.default_rng(seed)
    obs = env.reset()
    assert (env.load() == 1.0).all()
    low, high = observation_bounds(env.scenario)
    state_low, state_high = state_bounds(env.scenario)
    shares = [i for i, name in enumerate(env.state_names()) if name.endswith(".load")]
    assert len(shares) == env.num_robots
    at_depots = np.array([one.position_m for one in env.scenario.depots])
    for _ in range(20):
        load = env.load()
        assert load.dtype == np.float32
        assert (load[:, 0] == 1.0).all()
        assert np.isin(load, [0.0, 0.5, 1.0]).all()
        assert (obs >= low).all()
        assert (obs <= high).all()
        seen = obs[..., columns(env, ".load")]
        for robot in range(env.num_robots):
            others = [one for one in range(env.num_robots) if one != robot]
            assert (seen[:, robot] == load[:, [robot, *others]]).all()
        ways = at_depots - env.positions()[:, :, None]
        nearest = np.linalg.norm(ways, axis=-1).min(-1)
        depot = [env.observation_names().index(f"own.depot.{axis}") for axis in "xy"]
        np.testing.assert_allclose(np.linalg.norm(obs[..., depot], axis=-1), nearest, atol=1e-5)
        state = env.state()
        assert state.shape[1] == len(env.state_names()) == len(state_low)
        assert (state[:, shares] == load).all()
        assert (state >= state_low).all()
        assert (state <= state_high).all()
        obs = env.step(rng.integers(0, 5, (ENVS, env.num_robots))).obs


def test_a_copy_goes_on_with_the_same_loads() -> None:
    scenario = loaded(3, depots=(), episode_steps=300)
    env, other = BatchEnv(scenario, ENVS, seed=3), BatchEnv(scenario, ENVS, seed=4)
    rng = np.random.default_rng(1)
    env.reset()
    while (env.load() > 0.5).all():
        env.step(rng.integers(0, 5, (ENVS, 4)))
    other.restore(env.snapshot())
    for _ in range(30):
        assert (other.load() == env.load()).all()
        actions = rng.integers(0, 5, (ENVS, 4))
        one, two = env.step(actions), other.step(actions)
        assert (one.obs == two.obs).all()
        assert (one.reward == two.reward).all()


def test_a_depot_refills_at_the_end_of_the_step_in_which_its_robot_helped() -> None:
    medic = Scenario().robots[3].replace(load=1, start_m=(0.0, 0.0))
    task = {"name": "injured", "needs": ["medicine"]}
    values = {"robots": [medic], "tasks": [task], "situation": "single", "rescue_radius_m": 2.0}
    still = np.zeros((1, 1), int)
    env = BatchEnv(Scenario.model_validate(values), 1)
    env.reset()
    assert len(env.step(still).rescues) == 1
    assert env.load() == 0.0
    assert len(env.step(still).rescues) == 0
    at_a_depot = Scenario.model_validate({**values, "depots": [{"position_m": (0.1, 0.0)}]})
    env = BatchEnv(at_a_depot, 1)
    env.reset()
    for _ in range(3):
        assert len(env.step(still).rescues) == 1
        assert env.load() == 1.0


def test_columns_are_there_only_where_they_are_needed() -> None:
    plain = BatchEnv("mixed", 1)
    assert not columns(plain, ".load")
    assert not columns(plain, "depot.x")
    assert (plain.load() == 1.0).all()
    assert plain.load().shape == (1, 4)
    alone = BatchEnv(loaded(depots=()), 1)
    assert len(columns(alone, ".load")) == 4
    assert not columns(alone, "depot.x")
    both = BatchEnv(with_batteries(loaded()), 1)
    assert both.observation_names()[7:13] == [
        *("own.available", "own.charge", "own.load"),
        *("own.station.x", "own.station.y", "own.depot.x"),
    ]


def test_a_blackout_leaves_a_robot_its_own_load() -> None:
    faults = [{"robot": "food_1", "kind": "blackout", "value": 1.0}]
    env = BatchEnv(loaded(faults=faults), 1, seed=1)
    env.reset()
    row = env.step(np.zeros((1, 4), int)).obs[0, 1]
    own, *mates = columns(env, ".load")
    assert row[own] == env.load()[0, 1] > 0.0
    assert (row[[*mates, *columns(env, "depot.x"), *columns(env, "depot.y")]] == 0.0).all()


def test_views_play_with_loads() -> None:
    env = parallel_env(loaded(1))
    obs, _ = env.reset(seed=1)
    assert all(env.observation_space(agent).contains(row) for agent, row in obs.items())


def test_policies_for_any_team_see_no_loads() -> None:
    from innerattn.train.teams.sheet import TeamSheet

    scenario = loaded()
    with pytest.raises(ConfigError, match=r"robots\[1\].load = 2: there must be no load; policies"):
        TeamSheet(scenario, BatchEnv(scenario, 1).observation_names())
