"""What each action is worth to a robot; `innerattn.nn.teams.moves` for one vector at a time."""

from __future__ import annotations

from math import exp, hypot

from innerattn.policies.exported.table import Bodies

Vector = tuple[float, float]

GAINS_WIDTH = 9
_DIRECTIONS = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
_SHORTEST, _SHARPNESS = 1e-6, 20.0


class Moves:
    """The moves of one robot, the first of some."""

    def __init__(self, bodies: Bodies) -> None:
        """Take its body."""
        parts = (bodies.push, bodies.limit, bodies.kept, bodies.reach)
        push, limit, self._kept, self._reach = (float(part[0]) for part in parts)
        self._limit = max(limit, _SHORTEST)
        self._drives = [(push * across, push * along) for across, along in _DIRECTIONS]
        self._unit = max(min(push, limit) * self._reach, _SHORTEST)

    def gains(self, way: Vector, velocity: Vector) -> list[float]:
        """How much nearer +x, -x, +y and -y bring it than none does, and which of all is best.

        Args:
            way: to the place [m].
            velocity: of the robot [m/s], in the same frame.

        Returns:
            Gains of four actions, and a softmax over all five: `GAINS_WIDTH` numbers.
        """
        (x, y), (vx, vy) = way, velocity
        vx, vy = self._kept * vx, self._kept * vy
        left = []
        for across, along in self._drives:
            ux, uy = vx + across, vy + along
            far = self._reach * self._limit / max(hypot(ux, uy), self._limit)
            left.append(hypot(x - far * ux, y - far * uy))
        gains = [(left[0] - one) / self._unit for one in left]
        powers = [exp(_SHARPNESS * gain) for gain in gains]
        total = sum(powers)
        return [*gains[1:], *[power / total for power in powers]]
