"""A team as one agent of Gymnasium: its spaces, and how it observes and acts."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from innerattn.config.scenario import Scenario
from innerattn.envs.aligned import aligned_copy
from innerattn.envs.spaces import (
    robot_action_spaces,
    robot_observation_spaces,
    team_action_space,
    team_observation_space,
)
from innerattn.errors import ConfigError

Form = Literal["joint", "agents"]


class TeamForm:
    """All robots in one array, or each by its name.

    Raises:
        ConfigError: unknown form.
    """

    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]

    def __init__(self, scenario: Scenario, form: Form) -> None:
        if form not in get_args(Form):
            raise ConfigError(f"form = {form!r}: must be 'joint' or 'agents'")
        self._names = [robot.name for robot in scenario.robots] if form == "agents" else None
        if self._names is None:
            self.observation_space = team_observation_space(scenario)
            self.action_space = team_action_space(scenario)
        else:
            self.observation_space = spaces.Dict(robot_observation_spaces(scenario))
            self.action_space = spaces.Dict(robot_action_spaces(scenario))

    def observed(self, obs: NDArray[np.float32]) -> Any:
        """A copy of observations (..., R, D) as the form has them; of each robot (..., D)."""
        if self._names is None:
            return aligned_copy(obs)
        return {name: aligned_copy(obs[..., i, :]) for i, name in enumerate(self._names)}

    def lent(self, obs: NDArray[np.float32]) -> Any:
        """The same without a copy."""
        if self._names is None:
            return obs
        return {name: obs[..., i, :] for i, name in enumerate(self._names)}

    def actions(self, actions: Any, batch_axes: int = 0) -> NDArray[Any]:
        """Actions as (..., R), or (..., R, 2) where they are continuous; the worlds check them.

        Args:
            actions: as the form has them.
            batch_axes: axes before that of the robots.

        Raises:
            TypeError: no dict where the form has one.
            ValueError: actions that are not of these robots, or arrays of different shapes.
        """
        if self._names is None:
            return np.asarray(actions)
        if not isinstance(actions, dict):
            raise TypeError(f"actions is a {type(actions).__name__}: must be a dict by robot")
        if wrong := sorted(actions.keys() ^ set(self._names)):
            raise ValueError(f"actions must be of the robots {self._names}; differs in {wrong}")
        rows = [np.asarray(actions[name]) for name in self._names]
        if len({row.shape for row in rows}) > 1 or rows[0].ndim < batch_axes:
            raise ValueError(f"actions have shapes {[row.shape for row in rows]}: must be the same")
        return np.stack(rows, axis=batch_axes)


def team_rewards(rewards: NDArray[np.float32]) -> NDArray[np.float64]:
    """The sum of the robots' rewards (E, R) in each world, (E,)."""
    total: NDArray[np.float64] = rewards.astype(np.float64) @ np.ones(rewards.shape[1])
    return total  # a product: a sum along so short an axis takes longer
