"""What batteries mean for who goes where."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.policies.policy import WorldState
from innerattn.policies.scripted.steering import Array, Steering

_SPARE = 1.1
"""Robots reckon with so much more energy than a free way takes."""

_NEARLY_FULL = 0.95
"""Share of its capacity at which a robot leaves a station."""


class Charging:
    """The batteries and stations of one scenario.

    Attributes:
        is_needed: whether some robots have a battery; where not, everybody goes as ever.
    """

    def __init__(self, scenario: Scenario, steering: Steering) -> None:
        """Take batteries and stations from ``scenario``."""
        self.is_needed = scenario.has_batteries
        batteries = [robot.battery for robot in scenario.robots]
        self._capacity = np.array([one.capacity_j if one else np.inf for one in batteries])
        per_m = np.array([one.per_m_j if one else 0.0 for one in batteries])
        idle = np.array([one.idle_w if one else 0.0 for one in batteries])
        speed = np.maximum(steering.speed, 1e-9)
        self._per_m = _SPARE * (per_m + idle / speed)  # at full speed
        self._start_j = _SPARE * idle * steering.lag
        self._idle_w = idle
        self._radii = np.array([one.radius_m for one in scenario.stations])
        self._recharge_w = np.array([one.recharge_w for one in scenario.stations])
        self._stations = np.array([one.position_m for one in scenario.stations]).reshape(-1, 2)
        self._steering = steering

    def reckoned(self) -> list[tuple[float, float, float, float] | None]:
        """Capacity [J], energy for a metre [J/m] and for a start [J], and idle power [W] by robot.

        None for robots without a battery.
        """
        rows = np.stack([self._capacity, self._per_m, self._start_j, self._idle_w], -1).tolist()
        return [(*row,) if has else None for row, has in zip(rows, self._has_battery, strict=True)]

    def within_reach(self, state: WorldState, places: Array) -> NDArray[np.bool_]:
        """Which places robots can drive to and, from there, to the nearest station.

        Where there is no station, the way to the place is all. An empty robot reaches nothing, nor
        does one at a station until it is nearly full: who leaves with just enough for the nearest
        victim never comes to a farther one.

        Args:
            state: of the worlds, with their charges.
            places: (E, V, 2) [m].

        Returns:
            (E, R, V) bool.
        """
        charge = self.charge_j(state)[..., None]
        way = self._steering.way(places[:, None] - state.positions[:, :, None].astype(np.float64))
        starts = self._start_j[:, None]
        if len(self._stations):
            back = self._steering.way(places[:, :, None] - self._stations).min(-1)
            way, starts = way + back[:, None], 2.0 * starts
        free = ~self._is_charging(state)[..., None]
        return np.asarray((self._per_m[:, None] * way + starts <= charge) & (charge > 0.0) & free)

    def within_full_reach(self, places: Array) -> NDArray[np.bool_]:
        """Which places (E, V, 2) a full battery reaches from their nearest station, (E, R, V)."""
        if not len(self._stations):
            return np.zeros((len(places), len(self._capacity), places.shape[1]), np.bool_)
        way = 2.0 * self._steering.way(places[:, :, None] - self._stations).min(-1)
        needed = self._per_m[:, None] * way[:, None] + 2.0 * self._start_j[:, None]
        return np.asarray(needed <= self._capacity[:, None])

    def targets(self, state: WorldState, targets: Array, chosen: NDArray[np.int64]) -> Array:
        """Targets of all robots, where those without a victim that are not full go to charge.

        Args:
            state: of the worlds, with their charges.
            targets: (E, R, 2) [m], where robots go otherwise.
            chosen: (E, R) the victim slot that each robot goes to, -1 for none.
        """
        if not len(self._stations):
            return targets
        at = state.positions.astype(np.float64)
        nearest = self._steering.way(self._stations - at[:, :, None]).argmin(-1)
        charges = (chosen < 0) & (self.charge_j(state) < self._capacity) & self._has_battery
        return np.asarray(np.where(charges[..., None], self._stations[nearest], targets))

    def _is_charging(self, state: WorldState) -> NDArray[np.bool_]:
        """Which robots are at a station that has more to give them (E, R)."""
        if not len(self._stations):
            return np.zeros(state.positions.shape[:2], np.bool_)
        apart = self._stations - state.positions[:, :, None].astype(np.float64)
        near = (apart * apart).sum(-1) <= self._radii * self._radii
        gains = (near & (self._recharge_w > self._idle_w[:, None])).any(-1)
        return np.asarray(gains & (self.charge_j(state) < _NEARLY_FULL * self._capacity))

    @property
    def _has_battery(self) -> NDArray[np.bool_]:
        return np.asarray(np.isfinite(self._capacity))

    def charge_j(self, state: WorldState) -> Array:
        """Charges (E, R) [J]; infinite of robots without a battery."""
        if state.charge is None:
            raise ValueError("state.charge = None: must be given where robots have a battery")
        return np.where(self._has_battery, state.charge * self._capacity, np.inf)
