"""Lets a scripted policy play in many worlds, and keeps what happened for a value to be fitted.

Robots wander for a while at the beginning of each episode, so that the script is also seen where it
would never have gone itself.
"""

from __future__ import annotations

from contextlib import closing
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, Step
from innerattn.policies import PolicyInput, WorldState, scripted_policy

_MOST_WORLDS = 1024
_LONGEST_WANDERING = 0.5
"""Share of an episode."""
_CHANCE_OF_TURN = 0.2
"""Chance that a robot that wanders takes another action."""


class Play(NamedTuple):
    """T control steps of E worlds.

    Attributes:
        obs: (T, E, R, D) float32.
        reward: (T, E) float32, of the whole team for rescues.
        scripted: (T, E) bool, whether the script acted; from there on it acts to the episode's end.
        terminated: (T, E) bool.
        ended: (T, E) bool, terminated or truncated by a time limit.
        cut: (T, E) bool, steps whose successor is not here: ends of episodes, and the last step.
        after: (n, R, D) float32, observations after the n cut steps, in order.
    """

    obs: Tensor
    reward: Tensor
    scripted: Tensor
    terminated: Tensor
    ended: Tensor
    cut: Tensor
    after: Tensor


def play_script(
    name: str, scenario: Scenario, env_steps: int, *, seed: int, threads: int | None = None
) -> Play:
    """Play a script.

    Args:
        name: of the script.
        scenario: the worlds; actions are discrete.
        env_steps: length, summed over worlds; it is rounded up to whole steps of all worlds.
        seed: of everything random.
        threads: of the worlds.

    Raises:
        ConfigError: no such script.
        MemoryError: the observations do not fit.
    """
    worlds = min(_MOST_WORLDS, env_steps)
    steps = -(-env_steps // worlds)
    draws = np.random.default_rng(seed)
    script = scripted_policy(name, scenario, seed)
    with closing(BatchEnv(scenario, worlds, seed=seed, num_threads=threads)) as env:
        shape = (steps, worlds)
        obs = np.empty((*shape, env.num_robots, env.obs_width), np.float32)
        reward = np.zeros(shape, np.float32)
        scripted, terminated, ended = (np.empty(shape, np.bool_) for _ in range(3))
        after = []
        now = env.reset()
        wandering = _Wandering(env, draws)
        for t in range(steps):
            obs[t] = now
            wanders = wandering.worlds()
            chosen = script.act(PolicyInput(now, WorldState.of(env)))
            step = env.step(np.where(wanders[:, None], wandering.actions(), chosen))
            scripted[t] = ~wanders
            reward[t] = _rescue_reward(step, scenario)
            terminated[t] = step.terminated
            ended[t] = step.terminated | step.truncated
            after.append(step.final_obs[ended[t] if t < steps - 1 else slice(None)].copy())
            wandering.begin(ended[t])
            now = step.obs
    cut = ended.copy()
    cut[-1] = True
    arrays = (obs, reward, scripted, terminated, ended, cut, np.concatenate(after))
    return Play._make(torch.from_numpy(array) for array in arrays)


class _Wandering:
    """Robots that do not know what they do, at the beginning of episodes."""

    def __init__(self, env: BatchEnv, draws: np.random.Generator) -> None:
        self._env, self._draws = env, draws
        self._longest = int(_LONGEST_WANDERING * env.scenario.episode_steps)
        self._until = np.zeros(env.num_envs, np.int64)
        self._actions = self._any_actions()
        self.begin(np.ones(env.num_envs, np.bool_))

    def begin(self, episodes: NDArray[np.bool_]) -> None:
        """Draw anew how long robots wander in worlds (E,) where an episode begins [steps]."""
        drawn = self._draws.integers(0, self._longest, len(episodes), endpoint=True)
        self._until = np.where(episodes, drawn, self._until)

    def worlds(self) -> NDArray[np.bool_]:
        """Worlds (E,) in which robots wander now."""
        return self._env.step_counts() < self._until

    def actions(self) -> NDArray[np.int64]:
        """Actions (E, R): those of the last step, some of which change."""
        turn = self._draws.random(self._actions.shape) < _CHANCE_OF_TURN
        self._actions = np.where(turn, self._any_actions(), self._actions)
        return self._actions

    def _any_actions(self) -> NDArray[np.int64]:
        shape = (self._env.num_envs, self._env.num_robots)
        return self._draws.integers(0, self._env.num_actions, shape)


def _rescue_reward(step: Step, scenario: Scenario) -> NDArray[np.float32]:
    """The team's reward for the rescues of a step (E,)."""
    rescues = np.bincount(step.rescues["env"], minlength=len(step.obs))
    return (scenario.rescue_reward * rescues).astype(np.float32)
