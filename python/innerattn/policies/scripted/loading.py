"""What loads mean for who goes where."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.policies.policy import WorldState
from innerattn.policies.scripted.charging import Charging
from innerattn.policies.scripted.steering import Array, Steering


class Loading:
    """The loads and depots of one scenario.

    Attributes:
        is_needed: whether some robots have a load; where not, everybody goes as ever.
        has_depots: whether loads can be refilled.
    """

    def __init__(self, scenario: Scenario, steering: Steering, charging: Charging) -> None:
        """Take loads and depots from ``scenario``."""
        self.is_needed = scenario.has_loads
        self.has_depots = bool(scenario.depots)
        self._most = np.array([robot.load or 0 for robot in scenario.robots])
        self._depots = np.array([one.position_m for one in scenario.depots]).reshape(-1, 2)
        self._steering, self._charging = steering, charging

    def can_help(self, state: WorldState) -> NDArray[np.bool_]:
        """Which robots have something left to help with, (E, R)."""
        return np.asarray(self._load(state) > 0.0)

    def left(self, state: WorldState) -> NDArray[np.int64]:
        """Rescues that robots can help with before they go to a depot, (E, R); 0 without a load."""
        return np.asarray(np.rint(self._load(state) * self._most).astype(np.int64))

    def targets(self, state: WorldState, targets: Array, chosen: NDArray[np.int64]) -> Array:
        """Targets of all robots, where those without a victim that are not full go to a depot.

        A robot with a battery goes to the nearest of the depots from which its charge still takes
        it to a station.

        Args:
            state: of the worlds, with their loads.
            targets: (E, R, 2) [m], where robots go otherwise.
            chosen: (E, R) the victim slot that each robot goes to, -1 for none.
        """
        if not self.has_depots:
            return targets
        way = self._steering.way(self._depots - state.positions[:, :, None].astype(np.float64))
        if self._charging.is_needed:
            places = np.broadcast_to(self._depots, (len(way), *self._depots.shape))
            way = np.where(self._charging.within_reach(state, places), way, np.inf)
        goes = (chosen < 0) & (self._load(state) < 1.0) & np.isfinite(way).any(-1)
        return np.asarray(np.where(goes[..., None], self._depots[way.argmin(-1)], targets))

    def _load(self, state: WorldState) -> NDArray[np.float32]:
        """Loads (E, R), shares."""
        if state.load is None:
            raise ValueError("state.load = None: must be given where robots have a load")
        return state.load
