"""Moments worth a look, against the worlds themselves and against simple loops."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from watched import watched

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.measures.moments import (
    FAULT_KINDS,
    blocked,
    fault_spells,
    handoffs_of_all_robots,
    obstacle_places,
)
from innerattn.measures.sharing.handoff import handoffs
from innerattn.policies import PolicyInput
from innerattn.records.record import FIELDS, Record

LONE = {"name": "a", "kind": "k", "abilities": ["food"], "max_speed_mps": 1.0, "mass_kg": 1.0}


class Always:
    """Every robot does the same at every step."""

    name, needs_true_state = "always", False

    def __init__(self, action: int) -> None:
        self.action = action

    def act(self, view: PolicyInput) -> NDArray[Any]:
        return np.full(view.obs.shape[:2], self.action)

    def reset(self, seed: int) -> None:
        pass


def always(action: int, **fields: Any) -> Record:
    scenario = Scenario.preset("mixed").replace(episode_steps=40, contact_cost=1.0, **fields)
    return run_episodes(Always(action), scenario, 12, 3, record=FIELDS)


def touched(record: Record) -> NDArray[np.bool_]:
    """Whether the world said that a robot touched something, (E, T, R)."""
    contact = record.reward_names.index("contact")
    return np.asarray(record.steps["rewards"][..., contact] < 0.0)


def test_robots_that_drive_at_a_wall_are_blocked_there() -> None:
    found = blocked(record := always(1))
    wall = record.scenario.arena_half_width_m
    at_wall = record.steps["positions"][..., 0] > wall - 0.052
    assert at_wall[:, 30:].mean() > 0.3
    assert found[:, 30:-1][at_wall[:, 30:-1]].all()
    assert not found[:, -1].any()


@pytest.mark.parametrize("drive", ["unicycle", "differential"])
def test_robots_on_wheels_that_drive_at_a_wall_are_blocked_there(drive: str) -> None:
    robots = [robot.replace(drive=drive) for robot in Scenario.preset("mixed").robots]
    found = blocked(record := always(1, robots=robots))
    wall = record.scenario.arena_half_width_m
    angle = record.steps["headings"][..., 0]
    at_wall = record.steps["positions"][..., 0] > wall - 0.052
    faces_it = at_wall & (np.cos(angle) > 0.9) & (abs(record.steps["positions"][..., 1]) < 0.5)
    assert faces_it[:, 30:-1].any()
    assert found[:, 30:-1][faces_it[:, 30:-1]].all()
    assert not blocked(always(0, robots=robots)).any()
    assert not blocked(always(3, robots=robots)).any()


def test_nobody_is_blocked_who_does_not_drive_or_touches_nothing() -> None:
    assert not blocked(always(0)).any()
    record = watched(Scenario.preset("mixed").replace(contact_cost=1.0), episodes=30)
    found = blocked(record)
    assert found.any()
    assert touched(record)[found].all()


def test_obstacles_block_as_well() -> None:
    shapes = [{"shape": "disc", "radius_m": 0.2}, {"shape": "box", "half_extents_m": [0.3, 0.1]}]
    record = always(3, obstacles=shapes, robots=[LONE], tasks=[{"name": "t", "needs": ["food"]}])
    found = blocked(record)
    inside = np.abs(record.steps["positions"]).max(-1) < record.scenario.arena_half_width_m - 0.06
    assert (found & inside).any()
    assert touched(record)[found].all()


def test_a_robot_that_is_away_is_not_blocked() -> None:
    away = [{"robot": "food_0", "kind": "unavailable", "value": 1.0}]
    found = blocked(always(1, faults=away))
    assert not found[..., 0].any()
    assert found[..., 1:].any()


def test_what_blocked_needs() -> None:
    record = run_episodes(Always(1), Scenario.preset("mixed"), 1, 0, record=("actions",))
    with pytest.raises(ValueError, match="lacks faults, positions, velocities"):
        blocked(record)


def test_fault_spells_have_the_scenarios_steps() -> None:
    faults = [
        {"robot": "food_1", "kind": "motor_gain", "value": 0.25, "onset_step": 4},
        {
            "robot": "medical_0",
            "kind": "unavailable",
            "value": 1.0,
            "onset_step": 2,
            "duration_steps": 5,
        },
    ]
    spells = fault_spells(watched(Scenario.preset("mixed").replace(faults=faults), episodes=2))
    rows = [tuple(row) for row in spells.tolist()]
    gain, away = FAULT_KINDS.index("motor_gain"), FAULT_KINDS.index("unavailable")
    one = [(3, away, 2, 7, 1.0), (1, gain, 4, 25, 0.25)]
    assert rows == [(episode, *rest) for episode in (0, 1) for rest in one]
    assert len(fault_spells(watched(episodes=2))) == 0


def test_all_handoffs_are_those_of_each_robot() -> None:
    record = watched(episodes=60)
    found = handoffs_of_all_robots(record)
    each = [
        row.tolist()
        for robot in record.robot_names
        for tasks in (("task_1", "task_2"), ("task_2", "task_1"))
        for row in handoffs(record, robot, *tasks)
    ]
    assert sorted(map(tuple, each)) == sorted(map(tuple, found.tolist()))
    assert len(found) > 10
    assert (np.diff(found["episode"]) >= 0).all()


def test_obstacles_stand_where_the_episodes_had_them() -> None:
    shapes = [{"shape": "disc", "radius_m": 0.1}] * 2
    record = watched(Scenario.preset("mixed").replace(obstacles=shapes), episodes=4)
    with BatchEnv(record.scenario, 4, seed=record.seed) as env:
        env.reset()
        for _ in range(3):
            env.step(np.zeros((4, 4), np.int64))
        assert np.array_equal(obstacle_places(record), env.obstacles())
    assert obstacle_places(watched(episodes=2)).shape == (2, 0, 2)


def test_robots_of_other_layers_and_what_they_pass_block_nobody() -> None:
    two = [{**LONE, "start_m": [0.0, 0.0]}, {**LONE, "name": "other", "start_m": [0.105, 0.0]}]
    still = {"robot": "other", "kind": "unavailable", "value": 1.0}
    task = {"tasks": [{"name": "t", "needs": ["food"]}], "faults": [still]}
    heavy = {"mass_kg": 16.0, "drive_force_n": 0.0}

    def first(**of_other: object) -> NDArray[np.bool_]:
        robots = [two[0], {**two[1], **heavy, **of_other}]
        return blocked(always(1, robots=robots, **task))[:, :2, 0]

    assert first().any()
    assert not first(layer="air").any()
