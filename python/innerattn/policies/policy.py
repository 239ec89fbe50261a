"""What a policy may look at and what it gives; shared by scripted and trained policies."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from innerattn.envs import BatchEnv


class PolicyInput(NamedTuple):
    """What a policy may look at before it acts: the robots' observations and the true state.

    Attributes:
        obs: (E, R, D) float32.
        positions: (E, R, 2) float32 [m].
        velocities: (E, R, 2) float32 [m/s].
        victims: (E, V) structured: present, task, id, appeared_step, x, y [m].
        faults: (E, R) structured, the fields of `BatchEnv.fault_state`.
    """

    obs: NDArray[np.float32]
    positions: NDArray[np.float32]
    velocities: NDArray[np.float32]
    victims: NDArray[np.void]
    faults: NDArray[np.void]

    @classmethod
    def of(cls, env: BatchEnv, obs: NDArray[np.float32]) -> Self:
        """The present view of the worlds of ``env``, whose observations are ``obs``."""
        return cls(obs, env.positions(), env.velocities(), env.victims(), env.fault_state())


class Policy(Protocol):
    """Anything that drives a team."""

    @property
    def name(self) -> str:
        """What to call it in tables."""

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """Choose actions: (E, R) integers, or (E, R, 2) float32 where actions are continuous."""
