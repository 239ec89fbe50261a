"""What services, deadlines and the order of tasks mean for who goes where."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.policies.policy import WorldState


class Timing:
    """The services and deadlines of one scenario.

    Attributes:
        is_needed: whether there are any; where not, everybody goes as ever.
        has_order: whether victims may have to wait for others.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Take times from ``scenario``."""
        self._services, self._deadlines = scenario.has_services, scenario.has_deadlines
        self.is_needed = self._services or self._deadlines
        self.has_order = scenario.has_order
        self._service_s = np.array([task.service_s for task in scenario.tasks])
        self._dt = scenario.dt_s
        self._before = np.array(
            [[other.name in task.after for other in scenario.tasks] for task in scenario.tasks]
        )

    def in_time(
        self, state: WorldState, times: NDArray[np.float64], permitted: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Whether victims can be rescued before their deadline, each for itself.

        The soonest robot for each need goes there, and the service begins when the last one has
        come; the step that it comes with is the first one of the service.

        Args:
            state: of the worlds.
            times: (E, R, V) arrival times [s].
            permitted: (E, R, V, N) which robot can fill which need.

        Returns:
            (E, V) bool.
        """
        if not self._deadlines:
            return np.ones(state.victims.shape, np.bool_)
        soonest = np.where(permitted, times[..., None], np.inf).min(1)
        last = np.where(permitted.any(1), soonest, 0.0).max(-1)
        return np.asarray(last + self.work_s(state) <= self.left_s(state) + 1e-6)

    def work_s(self, state: WorldState) -> NDArray[np.float64]:
        """How long helpers must stay after the step that they come with, (E, V) float64 [s]."""
        victims = state.victims
        service = self._service_s[np.where(victims["present"], victims["task"], 0)]
        if self._services:
            service = service * (1.0 - victims["served"])
        return np.maximum(service - self._dt, 0.0)

    def left_s(self, state: WorldState) -> NDArray[np.float64]:
        """Time until victims are lost, (E, V) float64 [s]; infinite where they wait for ever."""
        victims = state.victims
        if not self._deadlines:
            return np.full(victims.shape, np.inf)
        left = (victims["deadline_step"] - state.step_counts[:, None]) * self._dt
        return np.where(victims["deadline_step"] < 0, np.inf, left)

    def waits_for(self, state: WorldState) -> NDArray[np.int64]:
        """The slots whose victims come before each victim, as bits, (E, V)."""
        victims = state.victims
        task = np.where(victims["present"], victims["task"], 0)
        before = self._before[task[:, :, None], task[:, None]]  # (E, V, V)
        before &= victims["present"][:, :, None] & victims["present"][:, None]
        before &= victims["appeared_step"][:, None] <= victims["appeared_step"][:, :, None]
        return np.asarray((before.astype(np.int64) << np.arange(victims.shape[1])).sum(-1))

    def held(self, state: WorldState, times: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Robots within the rescue radius of victims whose service has begun, (E, R, V) bool.

        Args:
            state: of the worlds.
            times: (E, R, V) arrival times [s].
        """
        if not self._services:
            return np.zeros(times.shape, np.bool_)
        return np.asarray((times == 0.0) & (state.victims["served"] > 0.0)[:, None])
