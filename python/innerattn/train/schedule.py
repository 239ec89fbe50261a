"""Follows a run's schedule: weighs reward components, and tells the learner the other numbers."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv, Step
from innerattn.errors import ConfigError
from innerattn.learn.framed import FramedLearner
from innerattn.learn.types import Learner, Scheduled, ScheduledLearner

_DENSE = "progress"
"""The reward component of shaping."""
_RESCUE = "rescue"


class Schedule:
    """The schedule of one run."""

    def __init__(self, config: RunConfig, env: BatchEnv, learner: Learner) -> None:
        """Begin at the start of the run.

        Raises:
            ConfigError: the learner cannot follow a schedule.
        """
        self._ramps = config.train.schedule
        self._env, self._world = env, config.scenario
        self._learner: ScheduledLearner | None = None
        if self._ramps != type(self._ramps)():
            inner = learner.learner if isinstance(learner, FramedLearner) else learner
            if not isinstance(inner, ScheduledLearner):
                raise ConfigError(
                    f"train.schedule: method {config.train.method!r} cannot follow one; "
                    "its learner has no method `follow`"
                )
            self._learner = inner
        self._weights: Tensor | None = None
        self.set_progress(0.0)

    def set_progress(self, share: float) -> None:
        """Follow the ramps to where ``share`` of the run is done, 0 to 1."""
        if self._learner is None:
            return
        ramps = self._ramps
        if ramps.weighs_rewards:
            dense = 1.0 if ramps.dense_weight is None else ramps.dense_weight.at(share)
            if ramps.team_credit is None:
                team = 1.0 if self._world.rescue_credit == "team" else 0.0
            else:
                team = ramps.team_credit.at(share)
            self._weights = torch.tensor([1.0 - team, team, dense, 1.0])
        self._learner.follow(
            Scheduled(
                gamma=None if ramps.gamma is None else ramps.gamma.at(share),
                entropy_weight=(
                    None if ramps.entropy_weight is None else ramps.entropy_weight.at(share)
                ),
                reward_weights=self._weights,
            )
        )

    def weigh(self, step: Step, reward: Tensor) -> tuple[Tensor, Tensor | None]:
        """The reward of a step, weighed as the schedule says.

        Args:
            step: what the worlds gave.
            reward: (E, R) their own reward.

        Returns:
            The reward (E, R) float32, and its parts (E, R, 4), or None where they are not weighed:
            the helpers' and the team's reward for rescues, shaping, and costs.
        """
        if self._weights is None:
            return reward, None
        parts = torch.from_numpy(self._parts(step)).to(reward.device)
        return parts @ self._weights.to(reward.device), parts

    def _parts(self, step: Step) -> NDArray[np.float32]:
        components = self._env.reward_components()
        names = self._env.reward_component_names
        parts = np.zeros((*components.shape[:2], 4), np.float32)
        rescues, reward = step.rescues, np.float32(self._world.rescue_reward)
        helpers = [name for name in rescues.dtype.names or () if name.startswith("helper_")]
        for name in helpers:
            helped = rescues[name] >= 0
            np.add.at(parts[..., 0], (rescues["env"][helped], rescues[name][helped]), reward)
        np.add.at(parts[..., 1], rescues["env"], reward)
        parts[..., 2] = components[..., names.index(_DENSE)]
        costs = [k for k, name in enumerate(names) if name not in (_DENSE, _RESCUE)]
        parts[..., 3] = components[..., costs].sum(axis=-1)
        return parts
