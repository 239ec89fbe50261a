"""Severities: what the worst is, and that every one is a fault that worlds take."""

import math
from contextlib import closing

import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.batch import FAULT_KINDS
from innerattn.evaluate.faults.severity import fault_of

SCENARIO = Scenario().replace(arena_half_width_m=0.7)
WORST = {
    "motor_gain": 0.0,
    "speed_limit": 0.0,
    "heading_bias": math.pi,
    "position_noise": 0.7,
    "velocity_noise": 1.5,
}


@pytest.mark.parametrize("kind", FAULT_KINDS)
def test_from_health_to_the_worst(kind: str) -> None:
    values = [fault_of(SCENARIO, 2, kind, x).value for x in (0.0, 0.25, 1.0)]
    healthy = 1.0 if kind in ("motor_gain", "speed_limit") else 0.0
    assert values[0] == healthy
    assert values[2] == WORST.get(kind, 1.0)
    assert values[1] == pytest.approx(healthy + 0.25 * (values[2] - healthy))
    fault = fault_of(SCENARIO, 2, kind, 1.0, onset_step=3)
    assert (fault.robot, fault.kind, fault.onset_step) == ("navigation_0", kind, 3)


@pytest.mark.parametrize("kind", FAULT_KINDS)
@pytest.mark.parametrize("severity", [0.0, 0.5, 1.0])
def test_worlds_take_all_of_them_even_in_huge_arenas(kind: str, severity: float) -> None:
    robots = [robot.replace(max_speed_mps=90.0) for robot in SCENARIO.robots]
    huge = SCENARIO.replace(arena_half_width_m=80.0, robots=robots, engine="discs")
    fault = fault_of(huge, 2, kind, severity)
    with closing(BatchEnv(huge.replace(faults=(fault,)), 1, num_threads=1)) as env:
        assert env.fault_state()[kind][0, 2] == pytest.approx(fault.value)
