"""The learner and the replay memory of MAAC's public code, imported as they are.

Iqbal & Sha 2019, "Actor-Attention-Critic for Multi-Agent Reinforcement Learning". Only logging is
left out. The code runs on today's PyTorch without a change.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import Team, Transitions


class _NoLog:
    """Takes the values that the public code logs, and writes none."""

    def add_scalar(self, *_: object) -> None:
        """One value."""

    def add_scalars(self, *_: object) -> None:
        """Several values."""


class PublicCode:
    """The learner and the replay memory of the public code, of our sizes and numbers.

    Attributes:
        model: The learner, an `AttentionSAC`.
        parameters: Count of the trained parameters of the critic and of all actors.
    """

    def __init__(self, checkout: Path, team: Team, network: NetworkConfig, td: TDConfig) -> None:
        """Build both.

        Raises:
            ImportError: Another package hides one of the checkout's.
        """
        # It calls `clip_grad_norm_` by an old name, which still works.
        warnings.filterwarnings("ignore", "`torch.nn.utils.clip_grad_norm`", FutureWarning)
        sys.dont_write_bytecode = True  # the checkout stays as it is
        sys.path.insert(0, str(checkout))
        learner, memory = _module("algorithms.attention_sac"), _module("utils.buffer")
        width, actions = team.obs_width, team.num_actions
        self.model = learner.AttentionSAC(
            [{"num_in_pol": width, "num_out_pol": actions}] * team.num_robots,
            [(width, actions)] * team.num_robots,
            gamma=td.gamma,
            tau=td.polyak,
            pi_lr=td.learning_rate,
            q_lr=td.learning_rate,
            reward_scale=td.reward_scale,
            pol_hidden_dim=network.hidden_width,
            critic_hidden_dim=network.hidden_width,
            attend_heads=network.attention_heads,
        )
        self.model.prep_training(device="cpu")
        self._replay = memory.ReplayBuffer(
            td.replay_capacity,
            team.num_robots,
            [width] * team.num_robots,
            [actions] * team.num_robots,
        )
        self._team, self._log = team, _NoLog()
        modules = [self.model.critic, *self.model.policies]
        self.parameters = sum(one.numel() for module in modules for one in module.parameters())

    def add(self, batch: Transitions) -> None:
        """Put transitions into the replay memory."""
        one_hot = np.eye(self._team.num_actions, dtype=np.float32)[batch.actions.numpy()]
        shape = tuple(batch.reward.shape)
        self._replay.push(
            batch.obs.numpy(),
            [one_hot[:, robot] for robot in range(self._team.num_robots)],
            batch.reward.numpy(),
            batch.next_obs.numpy(),
            np.broadcast_to(batch.terminated.numpy()[:, None], shape),
        )

    def sample(self, batch_size: int) -> Any:
        """Draw a batch, with rewards normalised over the whole memory."""
        return self._replay.sample(batch_size)

    def update(self, batch: Any) -> None:
        """Update critic, policies and targets, call by call as in its `main.py`."""
        self.model.update_critic(batch, logger=self._log)
        self.model.update_policies(batch, logger=self._log)
        self.model.update_all_targets()


def _module(name: str) -> Any:
    module = import_module(name)
    expected = Path(sys.path[0]).joinpath(*name.split(".")).with_suffix(".py")
    if Path(str(module.__file__)) != expected:
        raise ImportError(f"{name} is {module.__file__}, must be {expected}")
    return module
