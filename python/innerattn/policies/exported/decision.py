"""What an exported policy answers, and the motion that an action asks for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.contract import Contract, Member


class Decision(NamedTuple):
    """The answer for one robot and one control period.

    Attributes:
        action: number of the action; None where actions are continuous.
        probabilities: (A,) float32 of all actions; empty where actions are continuous.
        force: (2,) float32, share of full force along x and y of the world, of length 1 at most.
        row: (D,) float32, the observation that was acted on.
    """

    action: int | None
    probabilities: NDArray[np.float32]
    force: NDArray[np.float32]
    row: NDArray[np.float32]


def velocity_command(
    contract: Contract, robot: Member, force: NDArray[np.float32], velocity: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The velocity (2,) float32 that a force amounts to over a control period without contact.

    It is clip((1 - damping) v + F / m * dt, max_speed), as in `rust_env/src/robot.rs`.

    Args:
        contract: of the team.
        robot: whose constants count.
        force: (2,) float32, share of full force.
        velocity: (2,) float32, present velocity [m/s].
    """
    gain = np.float32(robot.drive_force_n / robot.mass_kg * contract.control_period_s)
    wanted = velocity * (np.float32(1.0) - np.float32(contract.damping)) + force * gain
    speed, most = np.sqrt((wanted * wanted).sum()), np.float32(robot.max_speed_mps)
    return wanted * (most / speed) if speed > most else wanted
