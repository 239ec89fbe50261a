"""Scripted policies: by hand in worlds of one's own making, and by their success in real ones."""

import numpy as np
import pytest

from innerattn.config import Fault, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.evaluate.play import run_episodes
from innerattn.policies import PolicyInput, WorldState
from innerattn.policies.scripted.dispatch import (
    SCRIPTED,
    GreedyPolicy,
    HungarianPolicy,
    OraclePolicy,
    RandomPolicy,
    scripted_policy,
)

HEALTHY = BatchEnv("mixed", 1).fault_state()
VICTIM = np.dtype([("present", "?"), ("task", "i8"), ("x", "f4"), ("y", "f4")])


def view(positions: list, victims: list) -> PolicyInput:
    """One world at rest; a victim is (task, x, y), or None for an empty slot."""
    table = np.array([(v and (True, *v)) or (False, 0, 0, 0) for v in victims], VICTIM)[None]
    places = np.asarray([positions], np.float32)
    state = WorldState(places, np.zeros_like(places), table, HEALTHY, np.zeros(1, int))
    return PolicyInput(np.zeros((1, 4, 1), np.float32), state)


def chosen(policy: GreedyPolicy | HungarianPolicy, seen: PolicyInput) -> list[int]:
    state = seen.known_state
    places = np.stack([state.victims["x"], state.victims["y"]], -1).astype(np.float64)
    return policy.choose(state, places)[0].tolist()


DOUBLE = Scenario.preset("double")
NEAR_THE_FIRST = view([(0, 0), (-0.1, 0), (0.8, 0), (0.5, 0.5)], [(0, 0.3, 0), (1, 0.9, 0)])


def test_greedy_sends_both_food_robots_to_the_nearest() -> None:
    assert chosen(GreedyPolicy(DOUBLE), NEAR_THE_FIRST) == [0, 0, 1, 0]


def test_hungarian_shares_the_work() -> None:
    assert chosen(HungarianPolicy(DOUBLE), NEAR_THE_FIRST) == [1, 0, 1, 0]


def test_the_later_arrival_decides() -> None:
    # food_0 is nearest to victim 0, but its medic is far away: food_1 is there in time as well.
    seen = view([(0, 0), (-0.3, 0), (0.9, 0), (-0.9, -0.9)], [(0, -0.05, 0), (1, 0.8, 0)])
    assert chosen(HungarianPolicy(DOUBLE), seen) == [1, 0, 1, 0]


def test_nobody_goes_where_nobody_is() -> None:
    mixed = Scenario.preset("mixed")
    seen = view([(0.5, 0.5), (-0.5, 0), (0.5, -0.5), (0, 0.5)], [None, (0, -0.5, 0.5)])
    assert chosen(HungarianPolicy(mixed), seen) == [-1, 1, -1, 1]
    assert chosen(GreedyPolicy(mixed), seen) == [1, 1, -1, 1]
    # navigation_0 stands at (0.5, -0.5) and is drawn to the centre: -x or +y.
    for policy in (HungarianPolicy(mixed), GreedyPolicy(mixed)):
        assert policy.act(seen)[0, 2] in (2, 3)


def test_random_actions_are_even_and_seeded() -> None:
    seen = PolicyInput(np.zeros((5000, 4, 1), np.float32))
    actions = RandomPolicy(DOUBLE, seed=1).act(seen)
    assert actions.shape == (5000, 4)
    counts = np.bincount(actions.ravel(), minlength=5)
    assert np.all(np.abs(counts - 4000) < 5 * np.sqrt(4000))
    np.testing.assert_array_equal(actions, RandomPolicy(DOUBLE, seed=1).act(seen))
    assert not np.array_equal(actions, RandomPolicy(DOUBLE, seed=2).act(seen))


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(
        ConfigError,
        match="'best': known are random, greedy, hungarian, planner, oracle, greedy-seen",
    ):
        scripted_policy("best", DOUBLE)


@pytest.mark.parametrize(
    ("situation", "greedy", "hungarian"),
    [("single", 2.1, 2.5), ("double", 3.5, 4.3), ("mixed", 2.3, 2.95)],
)
def test_dispatch_is_strong(situation: str, greedy: float, hungarian: float) -> None:
    scenario = Scenario.preset(situation)
    rescues = {}
    for name in SCRIPTED:
        policy = scripted_policy(name, scenario)
        assert policy.name == name
        record = run_episodes(policy, scenario, 400, seed=5, num_threads=1)
        rescues[name] = record.rescue_counts().mean()
    assert rescues["random"] < 0.1
    assert greedy < rescues["greedy"] < rescues["hungarian"]
    assert rescues["hungarian"] > hungarian


def test_continuous_worlds_are_served_as_well() -> None:
    scenario = Scenario.preset("double").replace(actions="continuous")
    rescues = [
        run_episodes(scripted_policy(name, scenario), scenario, 100, 5).rescue_counts().mean()
        for name in SCRIPTED
    ]
    assert rescues[0] < 0.3
    assert rescues[0] < 3 < rescues[1] < rescues[2]


def test_a_large_team_is_served_world_by_world() -> None:
    small = Scenario.preset("mixed")
    robots = [
        {**robot.model_dump(), "name": f"{robot.name}_{k}", "radius_m": 0.02}
        for k in range(3)
        for robot in small.robots
    ]
    scenario = small.replace(robots=robots, max_victims=6)
    few, many = (
        run_episodes(HungarianPolicy(worlds), worlds, 20, 5).rescue_counts().mean()
        for worlds in (small, scenario)
    )
    assert many > 2 * few


def failing(seen: PolicyInput, faults: np.ndarray) -> PolicyInput:
    return seen._replace(state=seen.known_state._replace(faults=faults))


def with_fault(kind: str, value: float) -> PolicyInput:
    """The world of `NEAR_THE_FIRST` with a fault of food_1, which hungarian sends to victim 0."""
    faults = HEALTHY.copy()
    faults[kind][:, 1] = value
    return failing(NEAR_THE_FIRST, faults)


def test_the_oracle_of_a_healthy_team_is_hungarian() -> None:
    for scenario in (DOUBLE, Scenario.preset("mixed"), DOUBLE.replace(actions="continuous")):
        records = [
            run_episodes(scripted_policy(name, scenario), scenario, 50, 5, record=("actions",))
            for name in ("hungarian", "oracle")
        ]
        np.testing.assert_array_equal(*(record.steps["actions"] for record in records))


@pytest.mark.parametrize("kind", ["unavailable", "motor_gain", "speed_limit"])
def test_the_oracle_sends_whom_it_can(kind: str) -> None:
    broken = with_fault(kind, 1.0 if kind == "unavailable" else 0.0)
    assert chosen(HungarianPolicy(DOUBLE), broken) == [1, 0, 1, 0]
    assert chosen(OraclePolicy(DOUBLE), broken)[0] == 0


def test_the_oracle_waits_where_there_is_hope() -> None:
    faults = HEALTHY.copy()
    faults["unavailable"][:, 3] = 1.0  # medical_0, for victim 0
    seen = view([(0, 0), (-0.1, 0), (0.8, 0), (0.5, 0.5)], [(0, 0.1, 0), (1, 0.9, 0)])
    assert chosen(OraclePolicy(DOUBLE), failing(seen, faults)) == [1, -1, 1, -1]


def test_the_oracle_keeps_more_than_one_that_knows_of_no_fault() -> None:
    for lost in ("navigation_0", "medical_0"):
        faults = (Fault(robot=lost, kind="unavailable", value=1.0),)
        scenario = Scenario.preset("mixed-1-food").replace(situation="double", faults=faults)
        hungarian, oracle = (
            run_episodes(scripted_policy(name, scenario), scenario, 100, 5).rescue_counts().mean()
            for name in ("hungarian", "oracle")
        )
        assert oracle > 1.5 * hungarian


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
@pytest.mark.parametrize(("kind", "value"), [("heading_bias", 3.0), ("speed_limit", 0.0)])
def test_the_oracle_lives_with_faults(actions: str, kind: str, value: float) -> None:
    faults = (Fault(robot="food_0", kind=kind, value=value),)
    scenario = DOUBLE.replace(actions=actions, faults=faults)
    hungarian, oracle = (
        run_episodes(scripted_policy(name, scenario), scenario, 300, 5).rescue_counts()
        for name in ("hungarian", "oracle")
    )
    gain = oracle - hungarian
    assert gain.mean() > 5 * gain.std() / len(gain) ** 0.5
