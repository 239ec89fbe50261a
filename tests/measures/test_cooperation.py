"""Cooperation counted by hand and by a plain loop."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config import Robot, Scenario, Task
from innerattn.measures.cooperation import (
    count_cooperation,
    count_pairs,
    pair_rates,
    shared_abilities,
)


def events(rows: list[tuple[int, ...]], helpers: int = 2) -> np.ndarray:
    names = ["task", *(f"helper_{k}" for k in range(helpers))]
    return np.array(rows, [(name, np.int64) for name in names])


# food_0 = 0, food_1 = 1, navigation_0 = 2, medical_0 = 3; helper_0 brings food.
SOME = events([(0, 0, 3), (0, 0, 3), (0, 1, 3), (1, 1, 2), (1, 1, 2), (1, 0, 2), (1, 1, 2)])


def test_table_2_by_hand() -> None:
    assert count_cooperation(SOME, Scenario()) == {
        "task_1": {"food_0": 2, "food_1": 1},
        "task_2": {"food_0": 1, "food_1": 3},
    }


def test_no_rescue_is_zero() -> None:
    assert count_cooperation(SOME[:0], Scenario()) == {
        "task_1": {"food_0": 0, "food_1": 0},
        "task_2": {"food_0": 0, "food_1": 0},
    }


def test_equation_10_by_hand() -> None:
    pairs = count_pairs(SOME, 4)
    expected = [[0, 0, 1, 2], [0, 0, 3, 1], [1, 3, 0, 0], [2, 1, 0, 0]]
    np.testing.assert_array_equal(pairs, expected)
    rates = pair_rates(pairs)
    np.testing.assert_allclose(rates[3], [2 / 3, 1 / 3, 0, 0])  # medical_0 with food_0, food_1
    np.testing.assert_allclose(rates[2], [1 / 4, 3 / 4, 0, 0])
    assert np.isnan(pair_rates(count_pairs(SOME[:3], 4))[2]).all()


@given(
    st.lists(
        st.lists(st.integers(0, 4), min_size=1, max_size=3, unique=True).map(
            lambda helpers: (0, *helpers, *[-1] * (3 - len(helpers)))
        ),
        max_size=20,
    )
)
def test_pairs_against_a_plain_loop(rows: list[tuple[int, ...]]) -> None:
    expected = np.zeros((5, 5), int)
    for _, *helpers in rows:
        for i in helpers:
            for j in helpers:
                if i != j and i >= 0 and j >= 0:
                    expected[i, j] += 1
    np.testing.assert_array_equal(count_pairs(events(rows, 3), 5), expected)


def test_any_team() -> None:
    def robot(name: str, *abilities: str) -> Robot:
        return Robot(name=name, kind="k", abilities=abilities, max_speed_mps=1.0, mass_kg=1.0)

    scenario = Scenario(
        robots=(
            robot("a", "lift", "see"),
            robot("b", "lift"),
            robot("c", "see"),
            robot("d", "dig"),
        ),
        tasks=(
            Task(name="heavy", needs=("lift", "lift")),
            Task(name="deep", needs=("dig", "see", "lift")),
            Task(name="hole", needs=("dig",)),
        ),
    )
    assert shared_abilities(scenario) == ("lift", "see")
    found = events([(0, 0, 1, -1), (0, 1, 0, -1), (1, 3, 0, 1), (1, 3, 2, 0), (2, 3, -1, -1)], 3)
    assert count_cooperation(found, scenario) == {
        "heavy": {"a": 2, "b": 2},
        "deep": {"a": 2, "b": 1, "c": 1},
        "hole": {},
    }
