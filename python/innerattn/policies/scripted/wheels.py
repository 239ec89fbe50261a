"""The law of motion of robots on wheels without contacts, for whole batches, in 64 bits.

Each control period sets the speed along the heading and the turn rate under their limits, and the
robot drives the arc that follows. Its velocity in the period is the chord of that arc, divided by
the period.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario

Array = NDArray[np.float64]

SHARES = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=np.float64)
"""What discrete actions ask of wheels: shares ahead and to the left."""


class Rolling(NamedTuple):
    """Speeds along headings [m/s] and turn rates [rad/s], arrays of one shape."""

    speed: Array
    turn_rate: Array


class Wheels:
    """The wheels of one team; the last axis of all arrays is that of its robots, but for pairs.

    Attributes:
        has: (R,) bool, who has wheels. What is computed for others means nothing.
        speed: (R,) highest speeds [m/s].
        turn: (R,) highest turn rates, which the wheels of a differential may keep from it [rad/s].
        full_turn: (R,) turn rates that a full share to the left asks for [rad/s].
        gain: (R,) what a period adds to a speed, or to that of a wheel, at most [m/s].
        turn_gain: (R,) what a period adds to a turn rate at most [rad/s].
        arm: (R,) how far the wheels of a differential are from its middle [m]; 0 of a unicycle.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Take the limits from ``scenario``."""
        robots, dt = scenario.robots, scenario.dt_s
        self.dt = dt
        self.has = np.array([robot.has_wheels for robot in robots])
        two = np.array([robot.drive == "differential" for robot in robots])
        self.arm = np.where(two, [0.5 * robot.track_m for robot in robots], 0.0)
        self.speed = np.array([robot.max_speed_mps for robot in robots])
        self.gain = np.array([robot.acceleration_m_s2 * dt for robot in robots])
        arm = np.where(two, self.arm, 1.0)
        most = np.array([robot.max_turn_rad_s for robot in robots])
        self.turn = np.where(two, np.minimum(most, self.speed / arm), most)
        turn_gain = np.array([robot.turn_acceleration_rad_s2 * dt for robot in robots])
        self.turn_gain = np.where(two, self.gain / arm, turn_gain)
        self.full_turn = np.where(two, self.speed / arm, most)
        self._most, self._two, self._continuous = most, two, scenario.actions == "continuous"

    def shares(self, actions: NDArray[Any]) -> Array:
        """Shares ahead and to the left (..., R, 2) that actions (..., R) or (..., R, 2) ask for."""
        if not self._continuous:
            return np.asarray(SHARES[actions])
        first, second = np.moveaxis(actions.astype(np.float64), -1, 0)
        wheels = np.stack([0.5 * (first + second), 0.5 * (second - first)], -1)
        return np.where(self._two[:, None], wheels, np.stack([first, second], -1))

    def actions(self, shares: Array) -> NDArray[np.float32]:
        """Continuous actions (..., R, 2) that ask for shares (..., R, 2)."""
        ahead, left = np.moveaxis(shares, -1, 0)
        wheels = np.stack([ahead - left, ahead + left], -1)
        # Turning comes first where a wheel cannot do both.
        beyond = np.maximum(np.abs(wheels).max(-1, keepdims=True) - 1.0, 0.0)
        wheels = np.where(beyond > 0.0, wheels - np.sign(ahead)[..., None] * beyond, wheels)
        found = np.where(self._two[:, None], wheels, shares)
        return np.clip(found, -1.0, 1.0).astype(np.float32)

    def rolling(self, velocities: Array, headings: Array, bias: Array | float = 0.0) -> Rolling:
        """How robots roll that had these velocities (..., R, 2) in the last period.

        Args:
            velocities: as contacts have left them [m/s].
            headings: (..., R, 2) angles [rad] and turn rates [rad/s].
            bias: (..., R) by which robots go beside their headings [rad].
        """
        angle, turn_rate = headings[..., 0], headings[..., 1]
        half = 0.5 * self.dt * turn_rate
        way = angle - half + bias
        along = velocities[..., 0] * np.cos(way) + velocities[..., 1] * np.sin(way)
        return Rolling(along / _sinc(half), np.asarray(turn_rate, np.float64))

    def after(
        self, now: Rolling, shares: Array, gain: Array | float = 1.0, cap: Array | float = 1.0
    ) -> Rolling:
        """How robots roll in the period that begins now, of which ``shares`` (..., R, 2) are asked.

        Args:
            now: before it.
            shares: ahead and to the left.
            gain: shares of what is asked that faulty motors give.
            cap: shares of the speed limits that are left.
        """
        ahead, left = shares[..., 0] * gain, shares[..., 1] * gain
        limit = self.speed * cap

        def toward(speed: Array, share: Array) -> Array:
            change = np.clip(share * self.speed - speed, -self.gain, self.gain)
            return np.asarray(np.clip(speed + change, -limit, limit))

        change = np.clip(left * self._most - now.turn_rate, -self.turn_gain, self.turn_gain)
        spread = now.turn_rate * self.arm
        slow, fast = (
            toward(now.speed - spread, ahead - left),
            toward(now.speed + spread, ahead + left),
        )
        turn_rate = np.where(
            self._two,
            (fast - slow) / np.where(self._two, 2.0 * self.arm, 1.0),
            now.turn_rate + change,
        )
        speed = np.where(self._two, 0.5 * (slow + fast), toward(now.speed, ahead))
        return Rolling(speed, np.clip(turn_rate, -self._most, self._most))

    def velocities(self, angle: Array, then: Rolling, bias: Array | float = 0.0) -> Array:
        """Velocities (..., R, 2) of a period that begins at headings ``angle`` (..., R) [m/s]."""
        half = 0.5 * self.dt * then.turn_rate
        way, length = angle + half + bias, then.speed * _sinc(half)
        return np.stack([length * np.cos(way), length * np.sin(way)], -1)


def _sinc(x: Array) -> Array:
    """Sine of x, divided by x."""
    return np.asarray(np.sinc(x / np.pi))


def wrapped(angle: Array) -> Array:
    """Angles from -pi to pi [rad]."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
