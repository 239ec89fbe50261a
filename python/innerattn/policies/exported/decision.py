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
        force: (2,) float32, what the action sets. Of a robot that pushes or sets its velocity:
            share of full force or speed along x and y of the world, of length 1 at most. Of a
            unicycle: shares of its speed and of its turn rate. Of a differential drive: shares of
            the speeds of its left and right wheel.
        row: (D,) float32, the observation that was acted on.
    """

    action: int | None
    probabilities: NDArray[np.float32]
    force: NDArray[np.float32]
    row: NDArray[np.float32]


def velocity_command(
    contract: Contract, robot: Member, force: NDArray[np.float32], velocity: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The velocity (2,) float32 that an action sets for a control period without contact.

    It is clip((1 - damping) v + F / m * dt, max_speed), as in `rust_env/src/robot.rs`; of a robot
    whose actions set its velocity it is that velocity.

    Args:
        contract: of the team.
        robot: whose constants count.
        force: (2,) float32, share of full force or speed.
        velocity: (2,) float32, present velocity [m/s].
    """
    most = np.float32(robot.max_speed_mps)
    if robot.drive == "velocity":
        wanted = force * most
    else:
        gain = np.float32(robot.drive_force_n / robot.mass_kg * contract.control_period_s)
        wanted = velocity * (np.float32(1.0) - np.float32(contract.damping)) + force * gain
    speed = np.sqrt((wanted * wanted).sum())
    return wanted * (most / speed) if speed > most else wanted


def twist_command(
    contract: Contract, robot: Member, shares: NDArray[np.float32], twist: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The speed [m/s] and turn rate [rad/s] (2,) that an action sets of a robot on wheels.

    They hold for a control period without contact, as in `rust_env/src/wheels.rs`.

    Args:
        contract: of the team.
        robot: whose limits count; it has wheels.
        shares: (2,) float32, `Decision.force`.
        twist: (2,) float32, its present speed along its heading and its turn rate.
    """
    assert robot.max_turn_rad_s is not None
    assert robot.acceleration_m_s2 is not None
    most, most_turn = np.float32(robot.max_speed_mps), np.float32(robot.max_turn_rad_s)
    gain = np.float32(robot.acceleration_m_s2 * contract.control_period_s)
    speed, turn = twist
    if robot.drive == "unicycle":
        assert robot.turn_acceleration_rad_s2 is not None
        turn_gain = np.float32(robot.turn_acceleration_rad_s2 * contract.control_period_s)
        speed = _approached(speed, shares[0] * most, gain)
        turn = _approached(turn, shares[1] * most_turn, turn_gain)
    else:
        wheels = wheel_speeds(robot, twist)
        left, right = (_approached(wheels[side], shares[side] * most, gain) for side in (0, 1))
        left, right = np.clip(left, -most, most), np.clip(right, -most, most)
        half = np.float32(0.5)
        speed, turn = half * (left + right), half * (right - left) / _arm(robot)
    return np.array([np.clip(speed, -most, most), np.clip(turn, -most_turn, most_turn)], np.float32)


def wheel_speeds(robot: Member, twist: NDArray[np.float32]) -> NDArray[np.float32]:
    """The speeds (2,) float32 [m/s] of the left and right wheel at a speed and a turn rate (2,).

    Args:
        robot: with a differential drive.
        twist: (2,) float32 [m/s, rad/s].
    """
    speed, turn = twist
    spread = turn * _arm(robot)
    return np.array([speed - spread, speed + spread], np.float32)


def _arm(robot: Member) -> np.float32:
    """From the middle to a wheel [m]."""
    assert robot.track_m is not None
    return np.float32(0.5 * robot.track_m)


def _approached(value: np.float32, to: np.float32, most: np.float32) -> np.float32:
    """A number nearer to another one, by so much at most."""
    return np.float32(value + np.clip(to - value, -most, most))
