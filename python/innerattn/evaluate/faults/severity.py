"""From a severity between none and the worst to the fault that is played."""

from __future__ import annotations

from innerattn import _core
from innerattn.config import Fault, Scenario

_HEALTHY_AND_WORST = {
    kind: (healthy, least if healthy == most else most)
    for kind, _, least, most, healthy, _ in _core.FAULT_KINDS
}


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
    healthy, worst = _HEALTHY_AND_WORST[kind]
    here = {"position_noise": scenario.arena_half_width_m, "velocity_noise": spec.max_speed_mps}
    value = healthy + severity * (min(worst, here.get(kind, worst)) - healthy)
    return Fault.model_validate(
        {"robot": spec.name, "kind": kind, "value": value, "onset_step": onset_step}
    )
