"""How scripts steer robots on wheels: towards a target, and slower while they face away from it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.policies.scripted.wheels import SHARES, Array, Rolling, Wheels, wrapped

_NEAR = 0.3
"""Share of the rescue radius within which a robot is at its target."""
_TURN = 1.0
"""Weight of the time to turn to a target, against that to drive there."""
_TIGHTER = 0.8
"""Share of the speed whose arc just leads to a target that is driven on it."""


class WheelSteering:
    """The steering of a team's robots on wheels; what it says of others means nothing."""

    def __init__(self, scenario: Scenario) -> None:
        """Take the limits from ``scenario``."""
        self.wheels = Wheels(scenario)
        self._radius = scenario.rescue_radius_m
        self._near = _NEAR * self._radius
        self._continuous = scenario.actions == "continuous"

    def turning_times(self, way: Array, headings: Array) -> Array:
        """Times to turn to places, to drive there forwards or backwards, (..., R, V) [s].

        Args:
            way: from the robots to the places, (..., R, V, 2) [m].
            headings: (..., R, 2) angles [rad] and turn rates [rad/s].
        """
        err = self._error(way, headings[..., None, 0])
        err = np.minimum(np.abs(err), np.pi - np.abs(err))
        return np.asarray(err / self.wheels.turn[:, None])

    def actions(
        self,
        way: Array,
        velocities: Array,
        headings: Array,
        faults: NDArray[np.void] | None,
    ) -> NDArray[Any]:
        """Actions that drive every robot to a target ``way`` (E, R, 2) away, to rest there.

        Args:
            way: [m].
            velocities: (E, R, 2) [m/s].
            headings: (E, R, 2) angles [rad] and turn rates [rad/s].
            faults: (E, R) structured, the fields of `BatchEnv.fault_state`; None: all are healthy.

        Returns:
            (E, R) int64, or (E, R, 2) float32 where actions are continuous.
        """
        gain = cap = np.ones(headings.shape[:-1])
        bias = np.zeros(headings.shape[:-1])
        if faults is not None:
            gain, cap = (faults[kind].astype(np.float64) for kind in ("motor_gain", "speed_limit"))
            bias = faults["heading_bias"].astype(np.float64)
        now = self.wheels.rolling(velocities, headings, bias)
        angle = headings[..., 0] + bias
        if self._continuous:
            return self._pursue(way, now, angle, gain, cap)
        return self._look_ahead(way, now, angle, gain, cap)

    def _error(self, way: Array, angle: Array) -> Array:
        return wrapped(np.arctan2(way[..., 1], way[..., 0]) - angle)

    def _pursue(
        self, way: Array, now: Rolling, angle: Array, gain: Array | float, cap: Array | float
    ) -> NDArray[np.float32]:
        """Drive the arc that leads to the target, forwards or backwards as the robot faces it."""
        wheels, dt = self.wheels, self.wheels.dt
        distance = np.sqrt((way * way).sum(-1))
        err = self._error(way, angle)
        # A robot that is fast one way goes on that way, unless the other one is clearly shorter.
        ahead = np.where(np.cos(err) + 0.3 * now.speed / wheels.speed >= 0.0, 1.0, -1.0)
        err = np.where(ahead > 0.0, err, wrapped(err + np.pi))
        turn = np.minimum(_braked(np.abs(err), wheels.turn_gain, dt), wheels.turn)
        speed = np.minimum(_braked(distance, wheels.gain, dt), wheels.speed * cap)
        arc = _TIGHTER * wheels.turn * distance / np.maximum(2.0 * np.abs(np.sin(err)), 1e-9)
        speed = np.where(np.abs(err) < 0.5 * np.pi, np.minimum(speed, arc), 0.0)
        speed, turn = self._turned_first(ahead * speed, np.sign(err) * turn, now)
        shares = np.stack([speed / wheels.speed, turn / wheels.full_turn], -1)
        there = distance < self._near
        shares = np.where(there[..., None], 0.0, shares / np.maximum(gain, 1e-9)[..., None])
        return wheels.actions(shares)

    def _turned_first(self, speed: Array, turn: Array, now: Rolling) -> tuple[Array, Array]:
        """What of a speed and a turn rate the two wheels of a differential reach in a period.

        They turn first. A unicycle reaches both by itself.
        """
        wheels = self.wheels
        spread = np.clip((turn - now.turn_rate) * wheels.arm, -wheels.gain, wheels.gain)
        room = wheels.gain - np.abs(spread)
        reached = now.speed + np.clip(speed - now.speed, -room, room)
        turned = now.turn_rate + spread / np.where(wheels.arm > 0.0, wheels.arm, 1.0)
        return reached, np.where(wheels.arm > 0.0, turned, turn)

    def _look_ahead(
        self, way: Array, now: Rolling, angle: Array, gain: Array, cap: Array
    ) -> NDArray[np.int64]:
        """The action that begins the best pair of actions, after which the robot stops."""
        costs = []
        for first in SHARES:
            then = self.wheels.after(now, first, gain, cap)
            left, turned = self._moved(way, angle, then)
            each = [
                self._cost(left, turned, self.wheels.after(then, second, gain, cap))
                for second in SHARES
            ]
            costs.append(np.minimum.reduce(each))
        return np.asarray(np.stack(costs, -1).argmin(-1))

    def _moved(self, way: Array, angle: Array, then: Rolling) -> tuple[Array, Array]:
        """The way that is left after a period, and the angle at its end."""
        dt = self.wheels.dt
        return way - self.wheels.velocities(angle, then) * dt, angle + then.turn_rate * dt

    def _cost(self, way: Array, angle: Array, then: Rolling) -> Array:
        """About how long a robot takes to its target that drives so for a period, and stops."""
        wheels, dt = self.wheels, self.wheels.dt
        way, angle = self._moved(way, angle, then)
        on, turned = (
            _rest(rate, gain, dt)
            for rate, gain in zip(then, (wheels.gain, wheels.turn_gain), strict=True)
        )
        along = angle + 0.5 * turned
        left = way - on[..., None] * np.stack([np.cos(along), np.sin(along)], -1)
        distance = np.sqrt((left * left).sum(-1))
        err = np.abs(self._error(left, angle + turned))
        err = np.minimum(err, np.pi - err) * np.clip(distance / self._radius - _NEAR, 0.0, 1.0)
        return np.asarray(distance / wheels.speed + _TURN * err / wheels.turn)


def _braked(left: Array, gain: Array, dt: float) -> Array:
    """The highest speed from which a robot that loses ``gain`` a period stops within ``left``."""
    slow = np.sqrt(0.25 * gain * gain + 2.0 * gain * left / dt) - 0.5 * gain
    return np.asarray(np.minimum(slow, left / dt))


def _rest(speed: Array, gain: Array, dt: float) -> Array:
    """How far a speed leads that loses ``gain`` in each period from now on."""
    periods = np.floor(np.abs(speed) / gain)
    return np.sign(speed) * periods * (np.abs(speed) - 0.5 * gain * (periods + 1.0)) * dt
