"""Steering against one-robot simulations of the law of motion, written out plainly."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn.config import Scenario
from innerattn.policies.scripted.steering import NEVER_S, Steering

SCENARIO = Scenario.preset("mixed")
DIRECTIONS = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]


def moved(robot: int, p: list[float], v: list[float], drive: tuple[float, float]) -> tuple:
    """One control period: v <- clip(0.75 v + F/m dt u), p <- p + v dt."""
    spec = SCENARIO.robots[robot]
    push = spec.drive_force_n / spec.mass_kg * 0.1
    v = [0.75 * v[k] + push * drive[k] for k in range(2)]
    speed = math.hypot(*v)
    if speed > spec.max_speed_mps:
        v = [x * spec.max_speed_mps / speed for x in v]
    return [p[k] + 0.1 * v[k] for k in range(2)], v


def test_speed_and_lag_by_hand() -> None:
    steering = Steering(SCENARIO)
    np.testing.assert_allclose(steering.speed, [1.0, 1.0, 1.5, 1.5])
    # Food from rest: 0.5, 0.875, then 1.0 m/s; the others: 1.0, then 1.5 m/s.
    np.testing.assert_allclose(steering.lag, [0.0625, 0.0625, 0.1 / 3, 0.1 / 3])


def test_arrival_times_by_hand() -> None:
    positions = np.zeros((1, 4, 2))
    velocities = np.zeros((1, 4, 2))
    velocities[0, 1] = [1.0, 0.0]
    velocities[0, 2] = [-1.5, 0.0]
    times = Steering(SCENARIO).arrival_times(positions, velocities, [[[0.65, 0.0], [0.1, 0.1]]])
    assert times.shape == (1, 4, 2)
    np.testing.assert_allclose(times[0, :, 0], [0.5625, 0.5, 0.4, 1 / 3 + 0.1 / 3])
    np.testing.assert_array_equal(times[0, :, 1], 0.0)


def test_a_robot_that_cannot_move_never_arrives() -> None:
    robots = [{**robot.model_dump(), "drive_force_n": 0.0} for robot in SCENARIO.robots]
    steering = Steering(SCENARIO.replace(robots=robots))
    times = steering.arrival_times(np.zeros((1, 4, 2)), np.zeros((1, 4, 2)), [[[0.5, 0.5]]])
    np.testing.assert_array_equal(times, NEVER_S)


@pytest.mark.parametrize("robot", range(4))
@pytest.mark.parametrize("distance", [0.3, 0.7, 1.4])
def test_arrival_times_match_a_straight_drive(robot: int, distance: float) -> None:
    p, v, periods = [0.0, 0.0], [0.0, 0.0], 0
    while p[0] < distance - 0.15:
        p, v = moved(robot, p, v, (1, 0))
        periods += 1
    times = Steering(SCENARIO).arrival_times(
        np.zeros((1, 4, 2)), np.zeros((1, 4, 2)), [[[distance, 0.0]]]
    )
    assert 0.1 * (periods - 1) - 1e-9 <= times[0, robot, 0] <= 0.1 * periods + 1e-9


def test_faults_of_the_drive_by_hand() -> None:
    healthy = np.zeros(
        (2, 4), [(name, "f4") for name in ("motor_gain", "speed_limit", "heading_bias")]
    )
    healthy["motor_gain"] = healthy["speed_limit"] = 1.0
    faults = healthy.copy()
    faults["speed_limit"][1, 0] = 0.5  # food_0 of world 1 starts at its cap of 0.5 m/s
    faults["motor_gain"][1, 2] = 0.25  # navigation_0 reaches 0.25 m/s a period / 0.25 = 1 m/s
    steering, still = Steering(SCENARIO), np.zeros((2, 4, 2))
    places = [[[0.65, 0.0]]] * 2
    well = steering.arrival_times(still, still, places)
    np.testing.assert_allclose(steering.arrival_times(still, still, places, healthy), well)
    times = steering.arrival_times(still, still, places, faults)
    np.testing.assert_allclose(times[0], well[0])
    np.testing.assert_allclose(times[1, :, 0], [1.0, well[1, 1, 0], 0.5 + 0.3, well[1, 3, 0]], 1e-6)
    faults["motor_gain"][0, 1] = 0.5  # what was found for other faults must not be used again
    times = steering.arrival_times(still, still, places, faults)
    fresh = Steering(SCENARIO).arrival_times(still, still, places, faults)
    np.testing.assert_array_equal(times, fresh)
    faults["heading_bias"][1, 3] = np.pi / 2  # told to go +x it goes +y, told -y it goes +x
    actions = steering.actions(still, still, np.tile([0.9, 0.0], (2, 4, 1)), faults)
    assert actions.tolist() == [[1, 1, 1, 1], [1, 1, 1, 4]]


coordinate = st.floats(-1, 1, width=32)


@settings(max_examples=200)
@given(st.integers(0, 3), *[st.tuples(coordinate, coordinate) for _ in range(3)])
def test_the_action_is_the_best_of_the_five(
    robot: int, p: tuple[float, float], v: tuple[float, float], target: tuple[float, float]
) -> None:
    arrays = (np.tile(np.asarray(value), (1, 4, 1)) for value in (p, v, target))
    chosen = Steering(SCENARIO).actions(*arrays)
    assert chosen.shape == (1, 4)
    misses = []
    for drive in DIRECTIONS:
        q, w = moved(robot, list(p), list(v), drive)
        q, _ = moved(robot, q, w, (0, 0))
        misses.append(math.dist(q, target))
    assert misses[chosen[0, robot]] == pytest.approx(min(misses), abs=1e-9)


@pytest.mark.parametrize("kind", ["discrete", "continuous"])
@pytest.mark.parametrize("robot", [0, 2])
def test_robots_arrive_in_time_and_stay(robot: int, kind: str) -> None:
    steering = Steering(SCENARIO.replace(actions=kind))
    rng = np.random.default_rng(0)
    for _ in range(40):
        p, v = list(rng.uniform(-0.9, 0.9, 2)), [0.0, 0.0]
        target = rng.uniform(-0.9, 0.9, 2)
        place = target[None, None]
        start = np.tile(np.asarray(p), (1, 4, 1))
        soonest = steering.arrival_times(start, np.zeros((1, 4, 2)), place)[0, robot, 0]
        inside = []
        for _ in range(40):
            state = (np.tile(np.asarray(x), (1, 4, 1)) for x in (p, v, target))
            action = steering.actions(*state)[0, robot]
            if kind == "continuous":
                drive = tuple(float(x) for x in action)
                assert max(map(abs, drive)) <= 1.0
                assert math.hypot(*drive) <= 1.0 + 1e-6
            else:
                drive = DIRECTIONS[action]
            p, v = moved(robot, p, v, drive)
            inside.append(math.dist(p, target) <= 0.15)
        first = inside.index(True)
        assert 0.1 * (first + 1) <= 1.25 * soonest + 0.2  # a zigzag costs a little
        assert all(inside[first:])


@given(
    p=st.tuples(*[st.floats(-1, 1)] * 2),
    v=st.tuples(*[st.floats(-1, 1)] * 2),
    target=st.tuples(*[st.floats(-1, 1)] * 2),
    continuous=st.booleans(),
)
def test_set_velocities_bring_robots_as_near_as_a_period_can(
    p: tuple[float, float], v: tuple[float, float], target: tuple[float, float], continuous: bool
) -> None:
    robots = tuple(robot.replace(drive="velocity") for robot in SCENARIO.robots)
    kind = "continuous" if continuous else "discrete"
    steering = Steering(SCENARIO.replace(robots=robots, actions=kind))
    np.testing.assert_array_equal(steering.lag, 0.0)
    np.testing.assert_array_equal(steering.speed, [robot.max_speed_mps for robot in robots])
    found = steering.actions(*(np.tile(np.array(one), (1, 4, 1)) for one in (p, v, target)))[0]
    for robot, action in zip(robots, found, strict=True):
        drive = action if continuous else DIRECTIONS[int(action)]
        far = 0.1 * robot.max_speed_mps
        left = math.dist(target, [p[k] + far * float(drive[k]) for k in range(2)])
        if continuous:
            best = max(0.0, math.dist(p, target) - far)
        else:
            ends = [[p[k] + far * way[k] for k in range(2)] for way in DIRECTIONS]
            best = min(math.dist(target, end) for end in ends)
        assert left <= best + 1e-6
