"""How small and how large observations and states of a scenario can be. It imports no library."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import hypot, log, sqrt

import numpy as np
from numpy.typing import NDArray

from innerattn import _core
from innerattn.config.scenario import Robot, Scenario
from innerattn.config.task import Task

Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Least and most values, arrays of one shape."""
Range = tuple[float, float]

_FAULT_RANGES = {name: (low, high) for name, _, low, high, _, _ in _core.FAULT_KINDS}
_FLAG: Range = (0.0, 1.0)
_MOST_NORMAL = sqrt(48 * log(2))
"""Largest size of a normal number that is made of a uniform one of 24 bits (Box & Muller)."""
_ROUNDING = 1.0 + 1e-5
"""What arithmetic of 32 bits may add."""
_ENERGY_GAIN = 1e-3
"""Largest share of the energy that a contact engine may add by pushing robots apart."""


def observation_bounds(scenario: Scenario) -> Bounds:
    """Bounds of any robot's observation, two arrays (D,) float32, the same for the whole team.

    Places are inside the arena. Contacts keep energy or lose some, so a robot is at most as fast as
    if it had all the energy of the team at its speed limits. Errors of a noisy sensor are finite
    because the random numbers have 24 bits.
    """
    speeds = _most_speeds(scenario)
    rows = [list(_observation_columns(scenario, own, speeds)) for own in range(scenario.num_robots)]
    low, high = _as_arrays(rows)
    return low.min(axis=0), high.max(axis=0)


def state_bounds(scenario: Scenario) -> Bounds:
    """Bounds of a world's state, two arrays (S,) float32."""
    place = _both_ways(scenario.arena_half_width_m)
    columns: list[Range] = []
    for speed in _most_speeds(scenario):
        columns += [place, place, _both_ways(speed), _both_ways(speed)]
        if scenario.has_wheels:
            columns += [_both_ways(1.0), _both_ways(1.0), _both_ways(_most_turn(scenario))]
        columns += [_FLAG] * (scenario.has_batteries + scenario.has_loads)
    for _ in range(scenario.num_victims):
        columns += [_FLAG] * len(scenario.tasks) + [place, place]
        columns += [_FLAG] * _columns_by_choice(scenario)
    columns += [place, place] * len(scenario.obstacles)
    return _as_arrays(columns)


def _observation_columns(scenario: Scenario, own: int, speeds: list[float]) -> Iterator[Range]:
    """Bounds of the columns that `BatchEnv.observation_names` names, of one robot."""
    abilities = sorted({ability for robot in scenario.robots for ability in robot.abilities})
    half = scenario.arena_half_width_m
    far, fast = (_most_error(scenario, own, kind) for kind in ("position_noise", "velocity_noise"))
    others = [robot for robot in range(scenario.num_robots) if robot != own]
    for robot in (own, *others):
        place = half + far if robot == own else 2 * half + far
        speed = speeds[own] + fast if robot == own else speeds[own] + speeds[robot] + fast
        yield from (_both_ways(place), _both_ways(place), _both_ways(speed), _both_ways(speed))
        yield from ((0.0, _most(scenario.robots, ability)) for ability in abilities)
        yield _FLAG  # availability
        if scenario.observe_faults:
            yield from (bounds for kind, bounds in _FAULT_RANGES.items() if kind != "unavailable")
        yield from [_FLAG] * (scenario.has_batteries + scenario.has_loads)
        yield from [_both_ways(1.0)] * (2 * scenario.has_wheels)  # heading
        if robot == own:
            spots = bool(scenario.stations) + bool(scenario.depots)
            yield from [_both_ways(2 * half + far)] * (2 * spots)
            if scenario.has_wheels:
                yield _both_ways(_most_turn(scenario))
            yield from [_FLAG] * scenario.max_rays
            continue
        if scenario.has_limited_sight:
            yield from (_FLAG, _FLAG)  # whether it is seen, and the time since then
        if scenario.limits_communication:
            yield _FLAG  # whether it is heard
    for _ in range(scenario.num_victims):
        yield _FLAG
        for ability in abilities:
            yield 0.0, _most(scenario.tasks, ability)
        yield from (_both_ways(2 * half + far), _both_ways(2 * half + far))
        yield from [_FLAG] * (_columns_by_choice(scenario) + scenario.has_limited_sight)
        # From a heading a victim is as far ahead, or aside, as it is away.
        yield from [_both_ways(sqrt(2.0) * (2 * half + far))] * (2 * scenario.has_wheels)


def _most(ones: Sequence[Robot | Task], ability: str) -> float:
    """Largest amount of an ability, at least 1."""
    return max(1.0, *(one.amount(ability) for one in ones))


def _columns_by_choice(scenario: Scenario) -> int:
    """How many columns of a victim are there only where the scenario asks for them."""
    return scenario.has_services + scenario.has_deadlines + scenario.has_order


def _most_turn(scenario: Scenario) -> float:
    """Highest turn rate of any robot [rad/s]."""
    return max(robot.max_turn_rad_s for robot in scenario.robots if robot.has_wheels)


def _most_speeds(scenario: Scenario) -> list[float]:
    """Speed of each robot that had all the energy of the team at its speed limits [m/s]."""
    energy = sum(robot.mass_kg * robot.max_speed_mps**2 for robot in scenario.robots)
    return [sqrt((1 + _ENERGY_GAIN) * energy / robot.mass_kg) for robot in scenario.robots]


def _most_error(scenario: Scenario, robot: int, kind: str) -> float:
    """Largest error of a robot's sense on one axis, under all the scenario's faults at once."""
    name = scenario.robots[robot].name
    noise = [fault.value for fault in scenario.faults if (fault.robot, fault.kind) == (name, kind)]
    return _MOST_NORMAL * min(hypot(*noise), _FAULT_RANGES[kind][1])


def _both_ways(most: float) -> Range:
    return -most * _ROUNDING, most * _ROUNDING


def _as_arrays(ranges: list[Range] | list[list[Range]]) -> Bounds:
    table = np.array(ranges, np.float32)
    return table[..., 0].copy(), table[..., 1].copy()
