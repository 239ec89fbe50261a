"""Assignment: every world's plan against scipy's, one world at a time."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from innerattn.config import Robot, Scenario, Task
from innerattn.policies.scripted import assignment
from innerattn.policies.scripted.assignment import (
    FORBIDDEN,
    Needs,
    assign,
    assign_whole_teams,
    can_be_rescued,
    pair_costs,
)


def priced(cost: np.ndarray, chosen: np.ndarray) -> tuple[int, float]:
    """Number of assigned robots and their total cost."""
    pairs = [(r, s) for r, s in enumerate(chosen) if s >= 0]
    assert len({s for _, s in pairs}) == len(pairs)
    return len(pairs), sum(cost[pair] for pair in pairs)


def reference(cost: np.ndarray) -> tuple[int, float]:
    rows, columns = linear_sum_assignment(cost)
    chosen = np.full(len(cost), -1)
    for r, s in zip(rows, columns, strict=True):
        if cost[r, s] < FORBIDDEN:
            chosen[r] = s
    return priced(cost, chosen)


# 4 x 4 and 3 x 5 go by enumeration, 7 x 7 and 3 x 30 world by world.
@settings(max_examples=60)
@given(
    shape=st.sampled_from(
        [(1, 1), (1, 4), (4, 1), (4, 2), (2, 4), (4, 4), (3, 5), (7, 7), (3, 30)]
    ),
    seed=st.integers(0, 2**32 - 1),
    forbidden=st.floats(0, 1),
)
def test_as_good_as_scipy(shape: tuple[int, int], seed: int, forbidden: float) -> None:
    rng = np.random.default_rng(seed)
    costs = rng.uniform(0, 3, (5, *shape))
    costs[rng.random(costs.shape) < forbidden] = FORBIDDEN
    chosen = assign(costs)
    for cost, row in zip(costs, chosen, strict=True):
        count, total = priced(cost, row)
        assert total < FORBIDDEN
        assert (count, pytest.approx(total, abs=1e-6)) == reference(cost)


def test_both_ways_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = np.random.default_rng(0).uniform(0, 3, (200, 4, 4))
    by_enumeration = assign(costs)
    monkeypatch.setattr(assignment, "_MOST_PLANS", 0)
    np.testing.assert_array_equal(assign(costs), by_enumeration)


def teams_by_trying(cost: np.ndarray, wanted: np.ndarray) -> dict[int, list[int]]:
    """Robots of each victim that gets a whole team, one victim after the other, by trying all."""
    robots, victims, _ = cost.shape
    free, left, found = set(range(robots)), set(range(victims)), {}
    while True:
        teams = {}
        for victim in sorted(left):
            size = int(wanted[victim])
            able = [
                team
                for team in permutations(sorted(free), size)
                if size
                and all(cost[robot, victim, need] < FORBIDDEN for need, robot in enumerate(team))
            ]
            if able:
                prices = [[cost[r, victim, need] for need, r in enumerate(team)] for team in able]
                best = min(range(len(able)), key=lambda one: sum(prices[one]))
                teams[victim] = (max(prices[best]), list(able[best]))
        if not teams:
            return found
        first = min(teams, key=lambda victim: teams[victim][0])
        found[first] = teams[first][1]
        free -= set(found[first])
        left.remove(first)


@settings(max_examples=80)
@given(
    shape=st.sampled_from([(3, 3, 3), (4, 3, 2), (5, 2, 4), (4, 2, 3), (5, 3, 3)]),
    seed=st.integers(0, 2**32 - 1),
    forbidden=st.sampled_from([0.0, 0.2, 0.5]),
)
def test_whole_teams_come_first_where_else_nobody_is_rescued(
    shape: tuple[int, int, int], seed: int, forbidden: float
) -> None:
    robots, victims, needs = shape
    rng = np.random.default_rng(seed)
    wanted = rng.integers(0, needs + 1, (6, victims))
    needed = np.arange(needs) < wanted[..., None]
    costs = rng.uniform(0.0, 3.0, (6, *shape))
    costs[~np.broadcast_to(needed[:, None], costs.shape)] = FORBIDDEN
    costs[rng.random(costs.shape) < forbidden] = FORBIDDEN
    flat = costs.reshape(6, robots, -1)
    plain, chosen = assign(flat), assign_whole_teams(flat, needed)
    for world in range(6):

        def team(slots: np.ndarray, victim: int, world: int = world) -> list[int]:
            """Robots by the need they fill."""
            return [
                int(robot)
                for need in range(wanted[world, victim])
                for robot in np.flatnonzero(slots[world] == victim * needs + need)
            ]

        if any(0 < wanted[world, v] == len(team(plain, v)) for v in range(victims)):
            np.testing.assert_array_equal(chosen[world], plain[world])
            continue
        first = teams_by_trying(costs[world], wanted[world])
        for victim, robots_of_it in first.items():
            assert team(chosen, victim) == robots_of_it
        rest = sorted(set(range(robots)) - {robot for one in first.values() for robot in one})
        others = costs[world][rest].copy()
        others[:, list(first)] = FORBIDDEN
        again = assign(others.reshape(1, len(rest), -1))[0] if rest else []
        assert chosen[world][rest].tolist() == list(again)


def test_a_service_that_goes_on_has_its_team_first() -> None:
    times = np.array([[0.0, 4.0, 4.5, 0.5], [5.0, 0.2, 0.1, 5.5]]).T[None]  # (1, R, V)
    permitted = np.ones((1, 4, 2, 4), bool)
    needed = np.ones((1, 2, 4), bool)
    held = np.zeros((1, 4, 2), bool)
    for robot, victim in ((0, 0), (1, 1)):
        held[:] = False
        held[0, robot, victim] = True
        chosen = assign_whole_teams(pair_costs(times, permitted, held), needed)
        assert (chosen // 4 == victim).all()


def test_permitted_by_hand() -> None:
    needs = Needs(Scenario.preset("double"))  # abilities sorted: food, information, medicine
    permitted = needs.permitted(np.array([[True, False], [True, True]]), np.array([[1, 0], [0, 1]]))
    assert permitted.shape == (2, 4, 2, 2)
    food, navigation, medical = [0, 1], [2], [3]
    expected = np.zeros((2, 4, 2, 2), bool)
    expected[0, food, 0, 0] = expected[0, navigation, 0, 1] = True
    expected[1, food, 0, 0] = expected[1, medical, 0, 1] = True
    expected[1, food, 1, 0] = expected[1, navigation, 1, 1] = True
    np.testing.assert_array_equal(permitted, expected)


def test_tasks_of_different_length() -> None:
    scenario = Scenario(
        tasks=(Task(name="one", needs=("medicine",)), Task(name="two", needs=("food", "food")))
    )
    permitted = Needs(scenario).permitted(np.ones((1, 2), bool), np.array([[0, 1]]))
    expected = np.zeros((1, 4, 2, 2), bool)
    expected[0, 3, 0, 0] = True
    expected[0, :2, 1, :] = True
    np.testing.assert_array_equal(permitted, expected)


def test_costs_by_hand() -> None:
    permitted = Needs(Scenario.preset("single")).permitted(np.array([[True]]), np.array([[0]]))
    times = np.array([[[1.0], [0.4], [0.1], [0.6]]])
    costs = pair_costs(times, permitted)
    # Food: the medical robot's 0.6 s, or more; medicine: the sooner food robot's 0.4 s, or more.
    expected = np.full((1, 4, 2), FORBIDDEN)
    expected[0, :2, 0] = [1.0 + 0.3, 0.6 + 0.12]
    expected[0, 3, 1] = 0.6 + 0.18
    np.testing.assert_allclose(costs, expected)


def test_a_robot_with_two_abilities_fills_one_need() -> None:
    both = Robot(
        name="both", kind="x", abilities=("food", "medicine"), max_speed_mps=1.0, mass_kg=1.0
    )
    food = both.model_copy(update={"name": "food", "abilities": ("food",)})
    scenario = Scenario(
        robots=(both, food), tasks=(Task(name="t", needs=("food", "medicine")),), situation="single"
    )
    permitted = Needs(scenario).permitted(np.array([[True]]), np.array([[0]]))
    chosen = assign(pair_costs(np.array([[[0.1], [5.0]]]), permitted))
    np.testing.assert_array_equal(chosen, [[1, 0]])


@settings(max_examples=60)
@given(shape=st.sampled_from([(1, 1, 1), (3, 2, 2), (5, 1, 3), (4, 3, 4)]), seed=st.integers(0, 99))
def test_who_can_be_rescued_by_trying_every_order(shape: tuple[int, int, int], seed: int) -> None:
    robots, victims, needs = shape
    rng = np.random.default_rng(seed)
    needed = rng.random((6, victims, needs)) < 0.7
    permitted = needed[:, None] & (rng.random((6, *shape)) < 0.5)
    found = can_be_rescued(permitted, needed)
    for world in range(6):
        for victim in range(victims):
            wanted = np.flatnonzero(needed[world, victim])
            assert found[world, victim] == any(
                all(permitted[world, r, victim, n] for r, n in zip(order, wanted, strict=True))
                for order in permutations(range(robots), len(wanted))
            )
