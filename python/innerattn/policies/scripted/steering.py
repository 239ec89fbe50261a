"""How a robot moves: when it can be somewhere, and which action brings it there.

Where faults of the drive are given, they are reckoned with. It follows the world's law of motion
without contacts: each control period starts with
v <- clip((1 - damping) v + F/m dt u, max_speed), and then p <- p + v dt. Where actions set the
velocity, it is v <- max_speed u. Robots on wheels are steered by `WheelSteering`. Where places of
obstacles are given, ways lead around them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.policies.exported.motion import final_speed_and_lag
from innerattn.policies.scripted.routes import Routes
from innerattn.policies.scripted.wheel_steering import WheelSteering

Array = NDArray[np.float64]

NEVER_S = 1e4
"""Arrival time of a robot that cannot move [s]; longer than any episode takes."""

_DIRECTIONS = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=np.float64)


class Steering:
    """The motion of one team.

    Attributes:
        speed: (R,) float64 final speed at full drive [m/s].
        lag: (R,) float64 time that a start from rest costs against that speed [s].
    """

    def __init__(self, scenario: Scenario) -> None:
        """Take speeds, masses and forces from ``scenario``."""
        robots = scenario.robots
        self._dt = scenario.dt_s
        self._keep = np.array([robot.kept(scenario.damping) for robot in robots])
        self._reach = self._dt * (1.0 + self._keep)[:, None]
        self._radius = scenario.rescue_radius_m
        self._limit = np.array([robot.max_speed_mps for robot in robots])
        self._push = np.array([robot.gain_mps(self._dt) for robot in robots])
        self._continuous = scenario.actions == "continuous"
        self._wheels = WheelSteering(scenario) if scenario.has_wheels else None
        self._rolls = np.array([robot.has_wheels for robot in robots])
        self.along_axes = not self._continuous and not self._rolls.all()
        self.speed, self.lag = self._speed_and_lag(self._push, self._limit)
        self._routes = Routes(scenario) if scenario.blocks_ways else None
        self._known: tuple[Array, Array, Array] | None = None

    def _speed_and_lag(self, push: Array, limit: Array) -> tuple[Array, Array]:
        """Final speeds [m/s] and lags [s] of robots that gain ``push`` a period up to ``limit``."""
        return final_speed_and_lag(self._keep, push, limit, self._dt)

    def bodies(self) -> Array:
        """What is known of robots without wheels beforehand, as policies for any team take it.

        Returns:
            (R, 6) float64: `speed`, `lag`, what one period of full drive adds to the speed [m/s],
            the share of it that is kept to the next, its limit [m/s], and how long a robot moves on
            at a speed, if it coasts after one period [s].
        """
        reach = self._reach[:, 0]
        parts = [self.speed, self.lag, self._push, self._keep, self._limit, reach]
        return np.stack(parts, -1)

    def _of_cases(self, cases: Array) -> tuple[Array, Array]:
        """Final speeds and lags (C, R) of drives that are left so much, (C, R * 2).

        Drives seldom change from one step to the next, so the last answer is kept.
        """
        if self._known is None or not np.array_equal(self._known[0], cases):
            gain, cap = np.moveaxis(cases.reshape(len(cases), -1, 2), -1, 0)
            # A weak motor takes longer; on wheels it is slower, too.
            most = np.where(self._rolls, np.minimum(gain, cap), cap)
            found = self._speed_and_lag(
                self._push * np.where(self._rolls, 1.0, gain), self._limit * most
            )
            self._known = (cases, *found)
        return self._known[1:]

    def way(self, apart: Array) -> Array:
        """Lengths of ways (..., 2) as robots drive them [m]: with discrete actions along axes.

        Robots on wheels drive straight on; in teams of both, the longer way counts for all.
        """
        if not self.along_axes:
            return np.asarray(np.sqrt((apart * apart).sum(-1)))
        return np.asarray(np.abs(apart).sum(-1))

    def arrival_times(
        self,
        positions: Any,
        velocities: Any,
        places: Any,
        faults: NDArray[np.void] | None = None,
        headings: Any = None,
        obstacles: NDArray[np.float32] | None = None,
    ) -> Array:
        """Estimated time until each robot is within the rescue radius of each place.

        The way at final speed, the part of the lag that the present velocity has not made up for
        already, and the time that a robot on wheels takes to turn to the way.

        Args:
            positions: (E, R, 2) [m].
            velocities: (E, R, 2) [m/s].
            places: (E, V, 2) [m].
            faults: (E, R) structured, the fields of `BatchEnv.fault_state`; None: all are healthy.
            headings: (E, R, 2) angles [rad] and turn rates [rad/s], for robots on wheels.
            obstacles: (E, O, 2) [m]; None: ways lead straight through them.

        Returns:
            (E, R, V) float64 [s]; 0 for a robot that is there, at most `NEVER_S`.
        """
        way = np.asarray(places, np.float64)[:, None] - np.asarray(positions)[:, :, None]
        distance = np.sqrt((way * way).sum(-1))
        gap = np.maximum(distance - self._radius, 0.0)
        if self._routes is not None and obstacles is not None:
            goals = np.broadcast_to(np.asarray(places)[:, None], way.shape)
            lengths, way = self._routes.ways(obstacles, positions, goals)
            gap = np.where(gap > 0.0, np.maximum(lengths - self._radius, 1e-9), 0.0)
            distance = np.sqrt((way * way).sum(-1))
        towards = (way * np.asarray(velocities)[:, :, None]).sum(-1) / np.maximum(distance, 1e-9)
        speed, lag = self.speed, self.lag
        if faults is not None:
            left = np.stack([faults["motor_gain"], faults["speed_limit"]], -1).astype(np.float64)
            cases, case = np.unique(left.reshape(len(left), -1), axis=0, return_inverse=True)
            speed, lag = (found[case.reshape(-1)] for found in self._of_cases(cases))
        speed, lag = np.maximum(speed, 1e-9)[..., None], lag[..., None]
        times = gap / speed + np.maximum(lag * (1.0 - towards / speed), 0.0)
        if self._wheels is not None and headings is not None:
            turning = self._wheels.turning_times(way, np.asarray(headings, np.float64))
            times = times + np.where(self._rolls[:, None], turning, 0.0)
        return np.where(gap > 0.0, np.minimum(times, NEVER_S), 0.0)

    def actions(
        self,
        positions: Any,
        velocities: Any,
        targets: Any,
        faults: NDArray[np.void] | None = None,
        headings: Any = None,
        obstacles: NDArray[np.float32] | None = None,
    ) -> NDArray[Any]:
        """Drive every robot to its target and let it come to rest there.

        The action chosen is the one after which, coasting for one period more, the robot is
        nearest to its target. Looking so little ahead it drives at full speed until the target is
        two periods away; looking further it would brake where braking is not needed. Robots on
        wheels are steered as `WheelSteering` says; these, and robots with continuous actions, drive
        to where their way turns first.

        Args:
            positions: (E, R, 2) [m].
            velocities: (E, R, 2) [m/s].
            targets: (E, R, 2) [m].
            faults: (E, R) structured, the fields of `BatchEnv.fault_state`; None: all are healthy.
            headings: (E, R, 2) angles [rad] and turn rates [rad/s], for robots on wheels.
            obstacles: (E, O, 2) [m]; None: ways lead straight through them.

        Returns:
            (E, R) int64, or (E, R, 2) float32 in [-1, 1] where actions are continuous.
        """
        way = np.asarray(targets, np.float64) - positions
        turn = way
        routes = self._routes if obstacles is not None else None
        if routes is not None and (self._continuous or self._wheels is not None):
            turn = routes.aims(obstacles, positions, targets)
        velocities = np.asarray(velocities, np.float64)
        found: NDArray[Any]
        if self._continuous:
            found = self._pushes(turn, velocities, faults)
        else:
            moves = self._moves(velocities, faults)
            if routes is not None:
                left = routes.left(obstacles, positions, moves, targets)
            else:
                miss = way[:, :, None] - moves
                left = (miss * miss).sum(-1)
            found = left.argmin(-1)
        if self._wheels is None:
            return found
        if headings is None:
            raise ValueError("headings = None: must be given where robots have wheels")
        headings = np.asarray(headings, np.float64)
        rolling = self._wheels.actions(turn, velocities, headings, faults)
        rolls = self._rolls[:, None] if self._continuous else self._rolls
        return np.where(rolls, rolling, found)

    def _pushes(
        self, way: Array, velocities: Array, faults: NDArray[np.void] | None
    ) -> NDArray[np.float32]:
        """The continuous actions of robots without wheels; see `actions`."""
        push, _, bias = self._drive(faults)
        wish = (way / self._reach - self._keep[:, None] * velocities) / np.maximum(push, 1e-12)[
            ..., None
        ]
        wish = _turned(wish, -bias)
        length = np.sqrt((wish * wish).sum(-1, keepdims=True))
        return np.asarray(wish / np.maximum(length, 1.0), np.float32)

    def _moves(self, velocities: Array, faults: NDArray[np.void] | None) -> Array:
        """How far each action brings robots without wheels that then coast for a period.

        (E, R, 5, 2) [m].
        """
        push, limit, bias = self._drive(faults)
        drives = _turned(_DIRECTIONS, np.expand_dims(bias, -1)) * push[..., None, None]
        after = (self._keep[:, None] * velocities)[:, :, None] + drives
        speed = np.sqrt((after * after).sum(-1, keepdims=True))
        after *= np.minimum(1.0, limit[..., None, None] / np.maximum(speed, 1e-12))
        return np.asarray(self._reach[:, None] * after)

    def _drive(self, faults: NDArray[np.void] | None) -> tuple[Array, Array, Array]:
        """What a push adds to speeds [m/s], speed limits [m/s] and biases [rad] of directions."""
        if faults is None:
            return self._push, self._limit, np.zeros(len(self._push))
        push, limit = self._push * faults["motor_gain"], self._limit * faults["speed_limit"]
        return push, limit, faults["heading_bias"].astype(np.float64)


def _turned(vectors: Array, angle: Array) -> Array:
    """Vectors (..., 2), turned counterclockwise [rad]."""
    sin, cos = np.sin(angle), np.cos(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], -1)
