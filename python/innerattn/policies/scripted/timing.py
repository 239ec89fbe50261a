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
        victims = state.victims
        if not self._deadlines:
            return np.ones(victims.shape, np.bool_)
        soonest = np.where(permitted, times[..., None], np.inf).min(1)
        last = np.where(permitted.any(1), soonest, 0.0).max(-1)
        service = self._service_s[np.where(victims["present"], victims["task"], 0)]
        if self._services:
            service = service * (1.0 - victims["served"])
        left = (victims["deadline_step"] - state.step_counts[:, None]) * self._dt
        enough = last + np.maximum(service - self._dt, 0.0) <= left + 1e-6
        return np.asarray(enough | (victims["deadline_step"] < 0))

    def held(self, state: WorldState, times: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Robots within the rescue radius of victims whose service has begun, (E, R, V) bool.

        Args:
            state: of the worlds.
            times: (E, R, V) arrival times [s].
        """
        if not self._services:
            return np.zeros(times.shape, np.bool_)
        return np.asarray((times == 0.0) & (state.victims["served"] > 0.0)[:, None])
