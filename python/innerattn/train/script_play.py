"""Lets a scripted policy play in many worlds, and keeps what happened for a value to be fitted."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy

_MOST_WORLDS = 1024


class Play(NamedTuple):
    """T control steps of E worlds.

    Attributes:
        obs: (T, E, R, D) float32.
        reward: (T, E) float32, of the whole team for rescues.
        terminated: (T, E) bool.
        ended: (T, E) bool, terminated or truncated by a time limit.
        cut: (T, E) bool, steps whose successor is not here: ends of episodes, and the last step.
        after: (n, R, D) float32, observations after the n cut steps, in order.
    """

    obs: Tensor
    reward: Tensor
    terminated: Tensor
    ended: Tensor
    cut: Tensor
    after: Tensor


def play_script(
    name: str,
    scenario: Scenario,
    env_steps: int,
    *,
    seed: int,
    threads: int | None,
    check: Callable[[], None],
) -> Play:
    """Play a script.

    Args:
        name: of the script.
        scenario: the worlds; actions are discrete.
        env_steps: length, summed over worlds; it is rounded up to whole steps of all worlds.
        seed: of everything random.
        threads: of the worlds.
        check: called before each step.

    Raises:
        ConfigError: no such script.
        MemoryError: the observations do not fit.
    """
    worlds = min(_MOST_WORLDS, env_steps)
    steps = -(-env_steps // worlds)
    script = scripted_policy(name, scenario, seed)
    with closing(BatchEnv(scenario, worlds, seed=seed, num_threads=threads)) as env:
        shape = (steps, worlds)
        obs = np.empty((*shape, env.num_robots, env.obs_width), np.float32)
        reward = np.zeros(shape, np.float32)
        terminated, ended = np.empty(shape, np.bool_), np.empty(shape, np.bool_)
        after = []
        now = env.reset()
        for t in range(steps):
            check()
            obs[t] = now
            step = env.step(script.act(PolicyInput(now, WorldState.of(env))))
            np.add.at(reward[t], step.rescues["env"], scenario.rescue_reward)
            terminated[t] = step.terminated
            ended[t] = step.terminated | step.truncated
            after.append(step.final_obs[ended[t] if t < steps - 1 else slice(None)].copy())
            now = step.obs
    cut = ended.copy()
    cut[-1] = True
    arrays = (obs, reward, terminated, ended, cut, np.concatenate(after))
    return Play._make(torch.from_numpy(array) for array in arrays)
