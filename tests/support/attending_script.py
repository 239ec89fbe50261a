"""A script whose robots attend to each other, by weights that follow from what they see."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.policies import PolicyInput, scripted_policy


class AttendingScript:
    """Plays like `hungarian`; attention has two heads."""

    name, needs_true_state = "attending", True

    def __init__(self, scenario: Scenario) -> None:
        self._script = scripted_policy("hungarian", scenario, 0)

    def reset(self, seed: int) -> None:
        self._script.reset(seed)

    def act(self, view: PolicyInput) -> NDArray[Any]:
        return np.asarray(self._script.act(view))

    def actor_attention(self, view: PolicyInput) -> NDArray[np.float32]:
        worlds, robots, columns = view.obs.shape
        mixed = np.random.default_rng(1).normal(size=(columns, 2 * robots))
        scores = (view.obs.astype(np.float64) @ mixed).reshape(worlds, robots, 2, robots)
        weights = np.exp(scores.transpose(0, 2, 1, 3)) * (1.0 - np.eye(robots))
        return (weights / weights.sum(-1, keepdims=True)).astype(np.float32)
