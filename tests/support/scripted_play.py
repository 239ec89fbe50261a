"""A script that plays episodes, and how often something is used up meanwhile."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy


def played(
    name: str, scenario: Scenario, left: Callable[[BatchEnv], NDArray[Any]], worlds: int = 16
) -> tuple[int, float]:
    """Rescues in an episode of each world, and the share of steps at which nothing is ``left``."""
    policy = scripted_policy(name, scenario)
    env = BatchEnv(scenario, worlds, seed=1, num_threads=1, autoreset="disabled")
    obs, rescues, used_up = env.reset(), 0, []
    for _ in range(scenario.episode_steps):
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        obs, rescues = step.obs, rescues + len(step.rescues)
        used_up.append((left(env) == 0.0).mean())
    return rescues, float(np.mean(used_up))
