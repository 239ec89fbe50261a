"""Where robots go first in the best plan for all victims that are there, world by world."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn import _core
from innerattn.config import Scenario
from innerattn.policies.policy import WorldState
from innerattn.policies.scripted.charging import Charging
from innerattn.policies.scripted.loading import Loading
from innerattn.policies.scripted.steering import Array, Steering
from innerattn.policies.scripted.timing import Timing

_ORDERS = 400
"""Orders of victims that are tried for a world in a step."""

_AIMS = {"mixed": (0.1, 1.0)}
"""By situation, what a plan keeps low: weights of the sum of the times of rescues, and of the last.

A wave of ``mixed`` ends with its last rescue; elsewhere each rescue counts when it comes."""


class Lookahead:
    """Plans for the victims of one scenario: their order, and who goes to each.

    Each victim in an order gets the robots that can begin soonest, those that have to wait for
    others after these. Up to four victims are planned for in every order; of more, a local search
    moves one at a time. A plan first keeps low how many victims are lost.
    """

    def __init__(
        self,
        scenario: Scenario,
        steering: Steering,
        timing: Timing,
        charging: Charging,
        loading: Loading,
    ) -> None:
        """Take the team and the tasks from ``scenario``."""
        self._timing, self._charging, self._loading = timing, charging, loading
        abilities = sorted({ability for robot in scenario.robots for ability in robot.abilities})
        robots = [
            (
                speed,
                lag,
                battery,
                robot.load,
                [robot.amount(ability) for ability in abilities],
            )
            for robot, speed, lag, battery in zip(
                scenario.robots,
                np.maximum(steering.speed, 1e-9).tolist(),
                steering.lag.tolist(),
                charging.reckoned(),
                strict=True,
            )
        ]
        needs = [
            (
                [abilities.index(need) for need in task.needs],
                [task.sums.get(ability, 0.0) for ability in abilities] if task.sums else None,
            )
            for task in scenario.tasks
        ]
        self._planner = _core.Dispatcher(
            robots,
            needs,
            [(one.position_m, one.radius_m, one.recharge_w) for one in scenario.stations],
            [(one.position_m, one.radius_m) for one in scenario.depots],
            scenario.rescue_radius_m,
            steering.along_axes,
            _AIMS.get(scenario.situation, (1.0, 0.0)),
            _ORDERS,
        )

    def choose(self, state: WorldState, places: Array, times: Array) -> NDArray[np.int64]:
        """The victim slot to which each robot goes.

        Args:
            state: of the worlds.
            places: (E, V, 2) [m].
            times: (E, R, V) arrival times [s].

        Returns:
            (E, R), -1 for a robot that no victim needs, or that goes to a stop first.
        """
        victims = state.victims
        numbers = np.stack([victims["task"], self._timing.waits_for(state)], -1)
        numbers[..., 0] = np.where(victims["present"], victims["task"], -1)
        work, left = self._timing.work_s(state), self._timing.left_s(state)
        none = np.zeros(state.positions.shape[:2])
        charges = self._charging.charge_j(state) if self._charging.is_needed else none
        loads = self._loading.left(state) if self._loading.is_needed else none.astype(np.int64)
        return self._planner.choose(
            state.positions.astype(np.float64),
            charges,
            loads,
            times,
            numbers,
            np.concatenate([places, work[..., None], left[..., None]], -1),
        )
