"""Handoffs by hand and against a plain loop."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config import Robot, Scenario, Task
from innerattn.evaluate.play import run_episodes
from innerattn.measures.sharing.handoff import (
    HANDOFF,
    handoffs,
    need_following_attention,
    rescues_nobody,
    window,
)
from innerattn.policies import scripted_policy
from innerattn.records.record import Record, rescue_dtype

# food_0, food_1, navigation_0, medical_0 are 0 to 3; task 0 needs food and medicine.
PARTNER = {0: 3, 1: 2}


def record_of(
    rows: list[tuple[int, int, int, int]], first_episode: int = 0, scenario: Scenario | None = None
) -> Record:
    """Events are (episode, step, task, food robot)."""
    scenario = scenario or Scenario()
    events = np.zeros(len(rows), rescue_dtype(scenario))
    for event, (episode, step, task, food) in zip(events, rows, strict=True):
        event["episode"], event["step"], event["task"] = episode, step, task
        event["helper_0"], event["helper_1"] = food, PARTNER[task]
    return Record(
        policy="p",
        scenario=scenario,
        robot_names=tuple(robot.name for robot in scenario.robots),
        seed=0,
        first_episode=first_episode,
        lengths=np.full(6, 25),
        rescues=events,
        reward_names=("rescue",),
        rewards_total=np.zeros((6, scenario.num_robots, 1)),
    )


def test_by_hand() -> None:
    rows = [
        (3, 4, 0, 0), (3, 6, 0, 1), (3, 9, 1, 0),  # food_0 hands over at 4, from the start
        (4, 2, 0, 0), (4, 5, 0, 0), (4, 6, 1, 1), (4, 8, 1, 0), (4, 12, 0, 0),  # at 5, since 3
        (5, 3, 0, 0),
        (6, 1, 1, 0),  # another episode
    ]  # fmt: skip
    record = record_of(rows, first_episode=3)
    expected = np.array([(3, 0, 3, 2, 0, 4, 9), (4, 0, 3, 2, 3, 5, 8)], HANDOFF)
    np.testing.assert_array_equal(handoffs(record, "food_0", "task_1", "task_2"), expected)
    back = np.array([(4, 0, 2, 3, 6, 8, 12)], HANDOFF)
    np.testing.assert_array_equal(handoffs(record, "food_0", "task_2", "task_1"), back)
    for robot in ("food_1", "medical_0"):
        assert len(handoffs(record, robot, "task_1", "task_2")) == 0


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 8), st.integers(0, 1), st.integers(0, 1)),
        max_size=25,
        unique_by=lambda row: (row[0], row[1], row[3]),  # a robot helps once in a step
    )
)
def test_against_a_plain_loop(rows: list[tuple[int, int, int, int]]) -> None:
    record = record_of(sorted(rows, key=lambda row: row[0]))  # steps in any order
    for robot in (0, 1):
        expected = []
        for episode in range(3):
            own = sorted((s, task) for e, s, task, food in rows if (e, food) == (episode, robot))
            start = 0
            for (first, task), (second, later) in pairwise(own):
                if (task, later) == (0, 1):
                    expected.append((episode, robot, 3, 2, start, first, second))
                start = first + 1
        found = handoffs(record, f"food_{robot}", "task_1", "task_2")
        assert found.tolist() == expected


def test_windows_and_who_rescues_in_them_by_hand() -> None:
    rows = [
        (3, 1, 1, 1), (3, 4, 0, 0), (3, 6, 0, 1), (3, 9, 1, 0),  # food_1 in between
        (4, 2, 0, 1), (4, 12, 0, 0), (4, 20, 1, 0), (4, 21, 0, 1),  # food_1 before and after
    ]  # fmt: skip
    record = record_of(rows, first_episode=3)
    events = handoffs(record, "food_0", "task_1", "task_2")
    low, high = window(events)
    assert (low.tolist(), high.tolist()) == ([0, 5], [9, 20])
    assert [part.tolist() for part in window(events, reach=2)] == [[3, 11], [6, 14]]
    other = events.copy()
    other["robot"] = 1
    assert rescues_nobody(record, other).tolist() == [False, True]
    assert rescues_nobody(record, other, reach=1).tolist() == [True, True]
    assert rescues_nobody(record, events).tolist() == [False, False]
    assert rescues_nobody(record, events[:0]).tolist() == []


@pytest.mark.parametrize("situation", ["single", "double", "mixed"])
def test_need_following_attention_against_a_plain_loop(situation: str) -> None:
    scenario = Scenario.preset(situation)
    policy = scripted_policy("hungarian", scenario)
    record = run_episodes(policy, scenario, 12, 3, first_episode=4)
    weights = need_following_attention(record)
    assert weights.shape == (12, scenario.episode_steps, 1, 4, 4)
    for e, t, robot in np.ndindex(12, scenario.episode_steps, 4):
        later = [
            row
            for row in record.rescues
            if row["episode"] == 4 + e
            and row["step"] >= t
            and robot in (row["helper_0"], row["helper_1"])
        ]
        expected = np.where(np.arange(4) == robot, 0.0, 1 / 3)
        if later:
            row = min(later, key=lambda row: row["step"])
            partner = row["helper_1"] if row["helper_0"] == robot else row["helper_0"]
            expected = np.eye(4)[partner]
        np.testing.assert_allclose(weights[e, t, 0, robot], expected, rtol=1e-6)


def test_several_partners_share_the_attention() -> None:
    scenario = Scenario(tasks=(Task(name="deep", needs=("food", "information", "medicine")),))
    events = np.zeros(1, rescue_dtype(scenario))
    events["helper_0"], events["helper_1"], events["helper_2"] = 1, 2, 3
    record = replace(record_of([], scenario=scenario), rescues=events)
    np.testing.assert_allclose(need_following_attention(record)[0, 0, 0, 1], [0, 0, 0.5, 0.5])


def test_the_same_partner_is_no_handoff() -> None:
    def robot(name: str, *abilities: str) -> Robot:
        return Robot(name=name, kind="k", abilities=abilities, max_speed_mps=1.0, mass_kg=1.0)

    team = Scenario(
        robots=(robot("a", "lift"), robot("b", "see", "dig"), robot("c", "see")),
        tasks=(
            Task(name="hole", needs=("dig", "lift")),
            Task(name="fog", needs=("lift", "see")),
            Task(name="deep", needs=("dig", "lift", "see")),
        ),
    )
    events = np.zeros(4, rescue_dtype(team))
    events["episode"], events["step"], events["task"] = [0, 0, 1, 1], [1, 2, 1, 2], [0, 1, 0, 1]
    events["helper_0"], events["helper_1"] = [1, 0, 1, 0], [0, 1, 0, 2]
    record = replace(record_of([], scenario=team), rescues=events)
    found = handoffs(record, "a", "hole", "fog")
    assert found.tolist() == [(1, 0, 1, 2, 0, 1, 2)]
    with pytest.raises(ValueError, match="'deep' has 3 needs"):
        handoffs(record, "a", "hole", "deep")


def test_unknown_names_are_refused() -> None:
    record = record_of([])
    assert handoffs(record, "food_0", "task_1", "task_2").dtype == HANDOFF
    with pytest.raises(ValueError, match="robot 'food_2': known are food_0, food_1"):
        handoffs(record, "food_2", "task_1", "task_2")
    with pytest.raises(ValueError, match="task 'task_3': known are task_1, task_2"):
        handoffs(record, "food_0", "task_3", "task_2")
    with pytest.raises(ValueError, match="both 'task_1'"):
        handoffs(record, "food_0", "task_1", "task_1")
