"""Where robots look for victims that they have not seen: along lanes, back and forth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario

_OVERLAP = 0.75
"""Distance of two lanes, in widths of what a robot sees on its way along one."""
_PACE = 0.8
"""How fast the places move on, in final speeds of the robots: in reach after a turn."""


class Sweep:
    """A place for each robot that moves along lanes over the whole arena and back again.

    Lanes are so near to each other that a robot on its way along them sees all that no obstacle
    hides. The places of robots begin at parts of the way that are evenly apart.
    """

    def __init__(self, scenario: Scenario, speed_mps: NDArray[np.float64]) -> None:
        """Take arena and sights from ``scenario``; ``speed_mps`` (R,) are final speeds."""
        half = scenario.arena_half_width_m
        self._lengths, self._ways = [], []
        for robot in scenario.robots:
            sight = min(robot.sight_m or half, half)
            lanes = max(1, math.ceil(half / (_OVERLAP * sight)))
            reach = half - half / lanes
            ends = max(half - sight / 2.0, 0.0)
            heights = np.linspace(-reach, reach, lanes)
            corners = [
                (end, height)
                for lane, height in enumerate(heights)
                for end in ((-ends, ends) if lane % 2 == 0 else (ends, -ends))
            ]
            way = np.array(corners)
            steps = np.linalg.norm(np.diff(way, axis=0), axis=-1)
            self._ways.append(way)
            self._lengths.append(np.concatenate([[0.0], steps.cumsum()]))
        self._pace = _PACE * speed_mps * scenario.dt_s

    def places(self, step_counts: NDArray[np.int64]) -> NDArray[np.float64]:
        """The places after so many steps (E,), (E, R, 2) [m]."""
        found = np.zeros((len(step_counts), len(self._ways), 2))
        for robot, (lengths, way) in enumerate(zip(self._lengths, self._ways, strict=True)):
            whole = max(float(lengths[-1]), 1e-9)
            start = whole * robot / len(self._ways)
            passed = (start + self._pace[robot] * step_counts) % (2.0 * whole)
            along = whole - abs(whole - passed)
            for axis in range(2):
                found[:, robot, axis] = np.interp(along, lengths, way[:, axis])
        return found
