"""From a severity between none and the worst to the fault that is played."""

from __future__ import annotations

import math

from innerattn.config import Fault, Scenario

_MOST_NOISE = 10.0  # what a scenario takes, m and m/s


def fault_of(
    scenario: Scenario, robot: int, kind: str, severity: float, onset_step: int = 0
) -> Fault:
    """The fault of some severity of one robot.

    Args:
        scenario: the worlds.
        robot: index of the robot.
        kind: of `innerattn.envs.batch.FAULT_KINDS`.
        severity: 0 leaves the robot as it is; 1 is the worst: no force, no speed, the opposite
            direction, an error of position as wide as half the arena, an error of velocity as large
            as the robot's top speed, or every control step struck.
        onset_step: the step at which it begins.
    """
    spec = scenario.robots[robot]
    worst = {
        "heading_bias": math.pi,
        "position_noise": min(scenario.arena_half_width_m, _MOST_NOISE),
        "velocity_noise": min(spec.max_speed_mps, _MOST_NOISE),
    }
    share_left = kind in ("motor_gain", "speed_limit")
    value = 1.0 - severity if share_left else severity * worst.get(kind, 1.0)
    return Fault.model_validate(
        {"robot": spec.name, "kind": kind, "value": value, "onset_step": onset_step}
    )
