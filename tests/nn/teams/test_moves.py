"""Gains of actions against plain loops, and against the scripts' steering."""

import math

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from innerattn.config import Robot, Scenario, Task
from innerattn.nn.teams.moves import GAINS_WIDTH, gains
from innerattn.policies.exported.moves import Moves
from innerattn.policies.exported.table import Bodies
from innerattn.policies.scripted.steering import Steering

DIRECTIONS = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
VECTORS = arrays(np.float64, 4, elements=st.floats(-2.0, 2.0))


def scenario_of(speed: float, mass: float, damping: float) -> Scenario:
    robot = Robot(name="a", kind="a", abilities=("a",), max_speed_mps=speed, mass_kg=mass)
    tasks = (Task(name="t", needs=("a",)),)
    return Scenario(situation="single", robots=(robot,), tasks=tasks, damping=damping)


def left_after_two_periods(scenario: Scenario, vector: np.ndarray) -> list[float]:
    """Distances [m] to the place after each action and a period of coasting, period by period."""
    (robot,), dt = scenario.robots, scenario.dt_s
    found = []
    for direction in DIRECTIONS:
        x, y, vx, vy = vector.tolist()
        for force in (robot.drive_force_n, 0.0):
            vx, vy = (
                (1.0 - scenario.damping) * v + force / robot.mass_kg * dt * along
                for v, along in zip((vx, vy), direction, strict=True)
            )
            if (speed := math.hypot(vx, vy)) > robot.max_speed_mps:
                vx, vy = vx * robot.max_speed_mps / speed, vy * robot.max_speed_mps / speed
            x, y = x - vx * dt, y - vy * dt
        found.append(math.hypot(x, y))
    return found


@given(
    vector=VECTORS,
    speed=st.floats(0.2, 3.0),
    mass=st.floats(0.1, 5.0),
    damping=st.floats(0.0, 0.9),
)
def test_they_are_those_of_plain_loops(
    vector: np.ndarray, speed: float, mass: float, damping: float
) -> None:
    scenario = scenario_of(speed, mass, damping)
    vector = vector.astype(np.float32).astype(np.float64)
    steering = Steering(scenario)
    bodies = steering.bodies().astype(np.float32)
    ways, velocities = (
        torch.tensor(part[None], dtype=torch.float32) for part in np.split(vector, 2)
    )
    found = gains(ways, velocities, torch.from_numpy(bodies))[0].numpy()
    assert found.shape == (GAINS_WIDTH,)

    left = left_after_two_periods(scenario, vector)
    (robot,) = scenario.robots
    push = min(robot.drive_force_n / robot.mass_kg * scenario.dt_s, speed)
    unit = push * scenario.dt_s * (2.0 - damping)
    nearer = [min(max((left[0] - one) / unit, -2.0), 2.0) for one in left[1:]]
    np.testing.assert_allclose(found[:4], nearer, atol=2e-4)
    powers = np.exp([20.0 * (min(left) - one) / unit for one in left])
    np.testing.assert_allclose(found[4:], powers / powers.sum(), atol=4e-3)

    clear = sorted(left)[1] - min(left) > 1e-4
    action = steering.actions([[vector[:2] * 0.0]], [[vector[2:]]], [[vector[:2]]])
    assert not clear or int(found[4:].argmax()) == int(action[0, 0])

    x, y, vx, vy = vector.tolist()
    on_robots = Moves(Bodies(*bodies.T)).gains((x, y), (vx, vy))
    np.testing.assert_allclose(on_robots, found, atol=4e-3)
