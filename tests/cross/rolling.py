"""Robots on wheels in float64, by the integrals of their arcs instead of chords and angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from stepper import Array, State, Stepper


def asked(plain: Stepper, actions: Array) -> Array:
    """Shares ahead and to the left (E, R, 2) of continuous actions (E, R, 2), which are wheels' or
    already these."""
    left, right = actions[..., 0], actions[..., 1]
    both = np.stack([(left + right) / 2, (right - left) / 2], -1)
    two = np.array([robot.drive == "differential" for robot in plain.scenario.robots])
    return np.where(two[:, None], both, actions)


def roll(plain: Stepper, state: State, drive: Array) -> tuple[Array, Array, Array]:
    """Velocities (E, R, 2), headings and turn rates (E, R) after a period of shares ``drive``."""
    robots, dt, faults = plain.scenario.robots, plain.scenario.dt_s, state.faults
    bias = faults["heading_bias"].astype(np.float64)
    ways, turned, rates = [], [], []
    for index, robot in enumerate(robots):
        heading, rate = state.headings[:, index], state.turn_rates[:, index]
        if not plain.rolls[index]:  # has no wheels
            ways.append(state.velocities[:, index])
            turned.append(heading)
            rates.append(rate)
            continue
        before = _arc(heading - rate * dt + bias[:, index], rate, dt)
        length = np.maximum(np.abs(before), 1e-12)
        moved = state.velocities[:, index] @ np.array([1, 1j])
        speed = (moved * before.conj()).real / length**2 * dt
        ahead, left = (drive[:, index, k] * faults["motor_gain"][:, index] for k in range(2))
        top = robot.max_speed_mps
        most = top * faults["speed_limit"][:, index].astype(np.float64)
        gain = robot.acceleration_m_s2 * dt
        if robot.drive == "unicycle":
            speed = _between(_between(top * ahead, speed - gain, speed + gain), -most, most)
            change = robot.turn_acceleration_rad_s2 * dt
            rate = _between(robot.max_turn_rad_s * left, rate - change, rate + change)
        else:
            base = 2 * robot.radius_m if robot.wheel_base_m is None else robot.wheel_base_m
            wheels = []
            for side in (-1, 1):
                now = speed + side * rate * base / 2
                wanted = _between(top * (ahead + side * left), now - gain, now + gain)
                wheels.append(_between(wanted, -most, most))
            speed, rate = (wheels[0] + wheels[1]) / 2, (wheels[1] - wheels[0]) / base
        rate = _between(rate, -robot.max_turn_rad_s, robot.max_turn_rad_s)
        way = _arc(heading + bias[:, index], rate, dt) * speed
        ways.append(np.stack([way.real, way.imag], -1) / dt)
        turned.append(heading + rate * dt)
        rates.append(rate)
    return np.stack(ways, 1), np.stack(turned, 1), np.stack(rates, 1)


def _arc(start: Array, rate: Array, time: float) -> Array:
    """Where speed 1 leads from an angle in a time, turning, as complex numbers."""
    straight = np.abs(rate) < 1e-6
    turning = np.where(straight, 1.0, rate)
    arc = (np.exp(1j * (start + turning * time)) - np.exp(1j * start)) / (1j * turning)
    return np.where(straight, np.exp(1j * start) * time, arc)


def _between(value: Array, low: Array | float, high: Array | float) -> Array:
    return np.asarray(np.minimum(np.maximum(value, low), high))
