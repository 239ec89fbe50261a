"""Ways around obstacles, as arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn import _core
from innerattn.config import Scenario

Array = NDArray[np.float64]

_ON_M = 1.0
"""How far ahead a robot aims that goes on after a turn, so that it does not stop there [m]."""


class Routes:
    """The shortest ways of one scenario's robots around the obstacles of its worlds."""

    def __init__(self, scenario: Scenario) -> None:
        """Take bodies and obstacles from ``scenario``."""
        self._found = _core.Routes(scenario.rules)

    def ways(self, obstacles: Any, positions: Any, goals: Any) -> tuple[Array, Array]:
        """Lengths of ways (E, R, G) and the vectors to their first turns (E, R, G, 2) [m].

        Args:
            obstacles: (E, O, 2) [m].
            positions: (E, R, 2) [m].
            goals: (E, R, G, 2) [m].
        """
        at = np.asarray(positions, np.float32)
        lengths, turns = self._found.ways(obstacles, at, np.asarray(goals, np.float32))
        return lengths.astype(np.float64), turns.astype(np.float64) - at[:, :, None]

    def aims(self, obstacles: Any, positions: Any, targets: Any) -> Array:
        """The vectors along which robots drive straight to targets (E, R, 2), (E, R, 2) [m].

        They lead to the first turn of the way and beyond, or to the target itself.
        """
        lengths, turns = self.ways(obstacles, positions, np.asarray(targets)[:, :, None])
        straight = np.sqrt((turns * turns).sum(-1))
        goes_on = (lengths > straight + 1e-6) & (straight > 0.0)
        on = np.where(goes_on, np.maximum(_ON_M / np.maximum(straight, 1e-9), 1.0), 1.0)
        return np.asarray((turns * on[..., None])[:, :, 0])

    def left(self, obstacles: Any, positions: Any, moves: Any, goals: Any) -> Array:
        """Lengths of the ways (E, R, K) that are left after straight moves [m].

        Args:
            obstacles: (E, O, 2) [m].
            positions: (E, R, 2) [m].
            moves: (E, R, K, 2), which end where an obstacle is in their way [m].
            goals: (E, R, 2) [m].
        """
        at = np.asarray(positions, np.float32)
        towards = (at[:, :, None] + moves).astype(np.float32)
        goals = np.asarray(goals, np.float32)
        return self._found.left(obstacles, at, towards, goals).astype(np.float64)
