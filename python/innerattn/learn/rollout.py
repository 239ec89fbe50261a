"""Rollouts of on-policy learners: collected steps, and rows to train on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.learn.types import Transitions


class Steps(NamedTuple):
    """T control steps of E worlds.

    Attributes:
        obs: (T, R, E, D).
        actions: (T, R, E) int64.
        reward: (T, R, E).
        next_obs: (T, R, E, D), of the same episode.
        terminated: (T, E) bool.
        ended: (T, E) bool, terminated or truncated by a time limit.
    """

    obs: Tensor
    actions: Tensor
    reward: Tensor
    next_obs: Tensor
    terminated: Tensor
    ended: Tensor

    @classmethod
    def stack(
        cls,
        steps: Sequence[tuple[Transitions, Tensor]],
        device: torch.device,
        dtype: torch.dtype,
    ) -> Steps:
        """Stack what `Learner.observe` was given, oldest step first; observations get ``dtype``."""
        batches, truncated = zip(*steps, strict=True)
        terminated = torch.stack([batch.terminated.to(device) for batch in batches])

        def robots_first(obs: list[Tensor]) -> Tensor:
            return torch.stack([one.to(device, dtype).transpose(0, 1) for one in obs])

        return cls(
            obs=robots_first([batch.obs for batch in batches]),
            actions=torch.stack([batch.actions.to(device).t() for batch in batches]),
            reward=torch.stack([batch.reward.to(device).t() for batch in batches]),
            next_obs=robots_first([batch.next_obs for batch in batches]),
            terminated=terminated,
            ended=terminated | torch.stack([flags.to(device) for flags in truncated]),
        )


class Rollout(NamedTuple):
    """Rows of a rollout, robots first.

    Attributes:
        obs: (R, B, D).
        actions: (R, B) int64.
        log_prob: (R, B) of the actions, under the policy that acted.
        value: (R, B) the critic's, when the steps were collected.
        advantage: (R, B).
        target: (R, B) for the critic's values.
    """

    obs: Tensor
    actions: Tensor
    log_prob: Tensor
    value: Tensor
    advantage: Tensor
    target: Tensor

    def take(self, rows: Tensor) -> Rollout:
        """Some rows, by their indices (n,) int64."""
        return Rollout._make(tensor[:, rows] for tensor in self)


def rows_of(steps: Tensor) -> Tensor:
    """Bring (T, R, E, ...) to rows (R, T * E, ...)."""
    return steps.transpose(0, 1).flatten(1, 2)


def steps_of(rows: Tensor, num_steps: int) -> Tensor:
    """Bring rows (R, T * E) back to (T, R, E)."""
    return rows.view(len(rows), num_steps, -1).transpose(0, 1)


def standardised(advantage: Tensor) -> Tensor:
    """Advantages (R, B) with mean 0 and standard deviation 1 for each robot."""
    centred = advantage - advantage.mean(dim=1, keepdim=True)
    return centred / (advantage.std(dim=1, correction=0, keepdim=True) + 1e-8)
