"""Finds the worlds in which victims have just appeared, and their states without these victims."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.envs import BatchEnv
from innerattn.envs.state import world_states


def afterstates(
    env: BatchEnv, going_on: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The afterstates of the step that ``env`` did last.

    Args:
        env: E worlds.
        going_on: (E,) bool, worlds whose episodes did not end with that step.

    Returns:
        (n,) the numbers of those of them in which victims appeared, in order, and their states
        (n, S), columns `BatchEnv.state_names`, in which these victims are absent.
    """
    victims = env.victims()
    new = victims["present"] & (victims["appeared_step"] == env.step_counts()[:, None])
    worlds = np.flatnonzero(new.any(axis=1) & going_on)
    victims = victims[worlds]
    victims["present"] &= ~new[worlds]
    moving = env.positions()[worlds], env.velocities()[worlds]
    others = env.obstacles()[worlds], env.step_counts()[worlds]
    stores = env.charge()[worlds], env.load()[worlds]
    pointing = env.headings()[worlds], env.turn_rates()[worlds]
    return worlds, world_states(*moving, victims, *others, env.scenario, *stores, *pointing)
