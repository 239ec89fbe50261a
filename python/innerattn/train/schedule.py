"""Follows a run's schedule: weighs parts of the reward, and tells the learner the other numbers."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv, Step
from innerattn.errors import ConfigError
from innerattn.learn.framed import unframed
from innerattn.learn.types import Learner, Scheduled, ScheduledLearner, Transitions
from innerattn.train.potential import Potential

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
        self._shaped = config.train.potential != "none"
        self._potential: Potential | None = None
        self._learner: ScheduledLearner | None = None
        if self._shaped or self._ramps != type(self._ramps)():
            inner = unframed(learner)
            if not isinstance(inner, ScheduledLearner):
                key = "train.potential" if self._shaped else "train.schedule"
                raise ConfigError(
                    f"{key}: method {config.train.method!r} cannot follow one; "
                    "its learner has no method `follow`"
                )
            self._learner = inner
        self._weights: Tensor | None = None
        self.set_progress(0.0)

    @property
    def potential(self) -> Potential | None:
        """What shapes rewards, if anything does yet."""
        return self._potential

    def shape(self, potential: Potential) -> None:
        """Let ``potential`` shape rewards; to be called before the first step if a run has one."""
        self._potential = potential

    def set_progress(self, share: float) -> None:
        """Follow the ramps to where ``share`` of the run is done, 0 to 1."""
        if self._learner is None:
            return
        ramps = self._ramps
        if self._shaped or ramps.weighs_rewards:
            dense = 1.0 if ramps.dense_weight is None else ramps.dense_weight.at(share)
            if ramps.team_credit is None:
                team = 1.0 if self._world.rescue_credit == "team" else 0.0
            else:
                team = ramps.team_credit.at(share)
            weights = [1.0 - team, team, dense, 1.0]
            if self._shaped:
                ramp = ramps.potential_weight
                weights.append(1.0 if ramp is None else ramp.at(share))
            self._weights = torch.tensor(weights)
        self._learner.follow(
            Scheduled(
                gamma=None if ramps.gamma is None else ramps.gamma.at(share),
                entropy_weight=(
                    None if ramps.entropy_weight is None else ramps.entropy_weight.at(share)
                ),
                reward_weights=self._weights,
            )
        )

    def weigh(self, transitions: Transitions, step: Step) -> Transitions:
        """A control step of all worlds with its reward weighed as the schedule says.

        Args:
            transitions: the E transitions with the worlds' own reward.
            step: what the worlds gave.

        Returns:
            The transitions with reward (E, R) float32 and `reward_parts` (E, R, P): the helpers'
            and the team's reward for rescues, shaping, costs and, if the run has one, the
            potential's. They are as given where nothing is weighed.
        """
        if self._weights is None:
            return transitions
        device = transitions.reward.device
        parts = torch.from_numpy(self._parts(step)).to(device)
        if self._potential is not None:
            shaping = self._potential.shaping(
                transitions.obs, transitions.next_obs, transitions.terminated
            )
            shaping = shaping.view(-1, 1, 1).expand(-1, parts.shape[1], 1)
            parts = torch.cat([parts, shaping], dim=2)
        reward = parts @ self._weights.to(device)
        return transitions._replace(reward=reward, reward_parts=parts)

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
