"""Gymnasium's spaces of a scenario, all bounds finite."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from innerattn.config.scenario import Scenario
from innerattn.envs.batch import NUM_DISCRETE_ACTIONS
from innerattn.envs.bounds import observation_bounds, state_bounds


def robot_observation_spaces(scenario: Scenario) -> dict[str, spaces.Space[Any]]:
    """The space of each robot's observations, (D,) float32, by its name."""
    low, high = observation_bounds(scenario)
    return {robot.name: spaces.Box(low, high, dtype=np.float32) for robot in scenario.robots}


def robot_action_spaces(scenario: Scenario) -> dict[str, spaces.Space[Any]]:
    """The space of each robot's actions by its name, each an object of its own."""
    return {robot.name: _action_space(scenario) for robot in scenario.robots}


def _action_space(scenario: Scenario) -> spaces.Space[Any]:
    if scenario.actions == "continuous":
        return spaces.Box(-1.0, 1.0, (2,), np.float32)
    return spaces.Discrete(NUM_DISCRETE_ACTIONS)


def team_observation_space(scenario: Scenario) -> spaces.Box:
    """The space of all robots' observations together, (R, D) float32."""
    low, high = (np.tile(bound, (scenario.num_robots, 1)) for bound in observation_bounds(scenario))
    return spaces.Box(low, high, dtype=np.float32)


def team_action_space(scenario: Scenario) -> spaces.Space[Any]:
    """The space of all robots' actions together: R integers, or (R, 2) float32."""
    if scenario.actions == "continuous":
        return spaces.Box(-1.0, 1.0, (scenario.num_robots, 2), np.float32)
    return spaces.MultiDiscrete([NUM_DISCRETE_ACTIONS] * scenario.num_robots)


def state_space(scenario: Scenario) -> spaces.Box:
    """The space of a world's state, (S,) float32."""
    low, high = state_bounds(scenario)
    return spaces.Box(low, high, dtype=np.float32)
