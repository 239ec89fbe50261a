"""Steps a learner's policy in a batch of worlds, and returns the transitions.

It does not learn, and stores only counts of episodes and rescues.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.envs import BatchEnv
from innerattn.learn import workers
from innerattn.learn.divergence import refuse_not_finite_reward
from innerattn.learn.resume import State, take, take_within
from innerattn.learn.types import Afterstates, Learner, Transitions
from innerattn.train.afterstates import afterstates
from innerattn.train.schedule import Schedule

_MOST = 2**62


@dataclass(frozen=True)
class Tally:
    """What happened since the last count.

    Attributes:
        episodes: those that ended.
        rescues: in those episodes, whenever they began.
        total_episodes: all that ended so far.
        all_rescues: of all worlds, whether or not their episodes have ended.
        all_lost: victims lost in all worlds; None where none can be lost.
        all_turned_away: victims that found no slot, in all worlds; None where none arrive.
    """

    episodes: int
    rescues: int
    total_episodes: int
    all_rescues: int
    all_lost: int | None = None
    all_turned_away: int | None = None


class Collector:
    """One policy acting in one batch of worlds, step by step."""

    def __init__(
        self,
        env: BatchEnv,
        learner: Learner,
        device: torch.device,
        schedule: Schedule | None = None,
        stagger_starts: bool = False,
        afterstates: bool = False,
    ) -> None:
        """Reset the worlds.

        Args:
            env: the worlds.
            learner: the policy.
            device: where tensors are made.
            schedule: weighs the rewards; None: they are the worlds' own.
            stagger_starts: let worlds be at different steps of their episodes.
            afterstates: tell the learner of worlds in which victims appear.
        """
        self._env = env
        self._learner = learner
        self._device = device
        self._schedule = schedule
        self._afterstates = afterstates
        self._obs = self._tensor(
            staggered(env, workers.rank() * env.num_envs) if stagger_starts else env.reset()
        )
        self._open_rescues: NDArray[np.int64] = np.zeros(env.num_envs, np.int64)
        self._episodes = self._rescues = self._total = self._all_rescues = 0
        self._all_lost = self._all_turned_away = 0

    def step(self) -> tuple[Transitions, Tensor]:
        """One control step of all worlds, with actions sampled from the policy.

        Returns:
            The transitions, obs (E, R, D) float32, actions (E, R) int64, reward (E, R) float32,
            next_obs (E, R, D) float32, terminated (E,) bool; and truncated (E,) bool. The next
            observation is always that of the same episode, also where a new one has begun.
        """
        actions = self._learner.act(self._obs)
        step = self._env.step(actions.cpu().numpy())
        truncated = self._tensor(step.truncated)
        transitions = Transitions(
            obs=self._obs,
            actions=actions,
            reward=self._tensor(step.reward),
            next_obs=self._tensor(step.final_obs),
            terminated=self._tensor(step.terminated),
        )
        if self._schedule is not None:
            transitions = self._schedule.weigh(transitions, step)
        if self._afterstates:
            going_on = ~(step.terminated | step.truncated)
            env, states = afterstates(self._env, going_on)
            found = Afterstates(self._tensor(env), self._tensor(states))
            transitions = transitions._replace(afterstates=found)
        refuse_not_finite_reward(transitions.reward)
        self._obs = self._tensor(step.obs)
        np.add.at(self._open_rescues, step.rescues["env"], 1)
        self._all_rescues += len(step.rescues)
        if self._env.scenario.has_deadlines:
            self._all_lost += len(self._env.lost())
        if self._env.scenario.has_arrivals:
            self._all_turned_away += int(self._env.turned_away().sum())
        self._count(step.terminated | step.truncated)
        return transitions, truncated

    def take_tally(self) -> Tally:
        """Counts since the last call, of all workers."""
        numbers = workers.total(self._counts()).tolist()
        self._episodes = self._rescues = self._all_rescues = 0
        self._all_lost = self._all_turned_away = 0
        tally, worlds = Tally(*numbers[:4]), self._env.scenario
        if worlds.has_deadlines:
            tally = replace(tally, all_lost=numbers[4])
        if worlds.has_arrivals:
            tally = replace(tally, all_turned_away=numbers[5])
        return tally

    def resume_state(self) -> dict[str, Tensor]:
        """All but the worlds; see `Resumable`."""
        return {
            "obs": self._obs,
            "open_rescues": torch.from_numpy(self._open_rescues),
            "tally": self._counts(),
        }

    def load_resume_state(self, state: State) -> None:
        """Go on from a state, with worlds that were restored; see `Resumable`."""
        self._obs = take(state, "obs", torch.float32, *self._obs.shape).to(self._device)
        worlds = len(self._open_rescues)
        rescues = take_within(state, "open_rescues", torch.int64, 0, _MOST, worlds)
        self._open_rescues = rescues.numpy().copy()
        tally = take_within(state, "tally", torch.int64, 0, _MOST, None).tolist()
        if not 3 <= len(tally) <= (most := len(self._counts())):
            raise ValueError(f"'tally' has {len(tally)} numbers: must have {most}")
        self._episodes, self._rescues, self._total = tally[:3]
        self._all_rescues = sum(tally[3:4])  # which older versions did not count, nor the next
        self._all_lost = sum(tally[4:5])
        self._all_turned_away = sum(tally[5:])

    def _counts(self) -> Tensor:
        """The numbers of a `Tally`, up to the last that these worlds have."""
        counts = [self._episodes, self._rescues, self._total, self._all_rescues]
        counts += [self._all_lost, self._all_turned_away]
        worlds = self._env.scenario
        return torch.tensor(
            counts[: 6 if worlds.has_arrivals else 5 if worlds.has_deadlines else 4]
        )

    def _count(self, ended: NDArray[np.bool_]) -> None:
        count = int(ended.sum())
        if count:
            self._episodes += count
            self._total += count
            self._rescues += int(self._open_rescues[ended].sum())
            self._open_rescues[ended] = 0

    def _tensor(self, array: NDArray[Any]) -> Tensor:
        # A copy, since the worlds reuse their buffers.
        return torch.tensor(array, device=self._device)


def staggered(env: BatchEnv, first: int = 0) -> NDArray[np.float32]:
    """Begin episodes so that worlds are at different steps of them; observations (E, R, D).

    Until then the robots stand still.

    Args:
        env: the worlds.
        first: number of the first of them, among those of all workers.
    """
    obs = env.reset()
    length = env.scenario.episode_steps
    shape = (env.num_envs, env.num_robots, *([2] if env.continuous else []))
    still = np.zeros(shape, np.float32 if env.continuous else np.int64)
    begins = (np.arange(env.num_envs) + first) % length
    for step in range(1, length):
        env.step(still)
        obs = env.reset(mask=begins == step)
    return obs
