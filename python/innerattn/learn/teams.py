"""Learns one policy for any team: imitates a script, improves by PPO, or both.

A rollout is T control steps of a batch of worlds of several teams; each step is a minibatch.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor
from torch.nn import functional

from innerattn.learn.advantage import generalised_advantage
from innerattn.nn.teams import Relations, TeamActor, TeamCritic

_ADVANTAGE_FLOOR = 0.02
_RETURN_FLOOR = 1e-2
_SLOWEST_AVERAGE = 0.05
_MOST_GRADIENT = 0.5


@dataclass
class TeamRollout:
    """T control steps of B worlds, N_t robots at step t.

    Attributes:
        seen: the worlds before each step.
        actions: (N_t,) int64 what was done.
        log_probs: (N_t,) of what was done.
        wanted: (N_t,) int64 what the script would have done; empty where nobody asked it.
        rewards: (B,) the team's.
        terminated: (B,) bool.
        ended: (B,) bool, terminated or truncated.
    """

    seen: list[Relations] = field(default_factory=list)
    actions: list[Tensor] = field(default_factory=list)
    log_probs: list[Tensor] = field(default_factory=list)
    wanted: list[Tensor] = field(default_factory=list)
    rewards: list[Tensor] = field(default_factory=list)
    terminated: list[Tensor] = field(default_factory=list)
    ended: list[Tensor] = field(default_factory=list)


@dataclass(frozen=True)
class Weights:
    """What an update weighs.

    Attributes:
        learning_rate: step size of Adam.
        imitation: of the cross-entropy to what the script would have done; 1 and `policy` 0: pure
            imitation.
        policy: of PPO's loss.
        entropy: of the policy's entropy, within PPO's loss.
    """

    learning_rate: float
    imitation: float
    policy: float
    entropy: float


class TeamLearner:
    """An actor, a critic, and one Adam for both."""

    def __init__(
        self,
        *,
        width: int,
        pooling: str,
        key_width: int,
        gamma: float,
        gae_lambda: float,
        clip: float,
        seed: int,
    ) -> None:
        """Draw initial weights; what is drawn follows from ``seed`` alone."""
        with torch.random.fork_rng([]):
            torch.manual_seed(seed)
            self.actor = TeamActor(width, pooling, key_width)
            self.critic = TeamCritic()
        self._gamma, self._lambda, self._clip = gamma, gae_lambda, clip
        self._generator = torch.Generator().manual_seed(seed)
        self._parameters = [*self.actor.parameters(), *self.critic.parameters()]
        self._adam = torch.optim.Adam(self._parameters, eps=1e-6, fused=True)
        self._mean, self._std = torch.zeros(()), torch.ones(())
        self.updates = self.rollouts = 0

    @torch.no_grad()
    def act(self, seen: Relations) -> tuple[Tensor, Tensor]:
        """Draw actions (N,) int64; and their log-probabilities (N,)."""
        log_probs = self.actor(seen)
        noise = torch.empty_like(log_probs).exponential_(generator=self._generator)
        actions = (log_probs.exp() / noise).argmax(1)
        return actions, log_probs.gather(1, actions[:, None]).squeeze(1)

    @torch.no_grad()
    def values(self, seen: Relations) -> Tensor:
        """Values (B,) in units of the rewards."""
        found: Tensor = self.critic(seen) * self._std + self._mean
        return found

    def learn(
        self, rollout: TeamRollout, after: Relations, groups: int, weights: Weights
    ) -> dict[str, float]:
        """One pass over a rollout.

        Args:
            rollout: the steps.
            after: the worlds after the last one.
            groups: number of teams; B is a multiple of it, team by team. Advantages are
                standardised within each.
            weights: of the losses.

        Returns:
            Means by name: `agreement` with the script, `entropy` [nats], `kl` [nats],
            `value_error`.
        """
        advantage, target = self._targets(rollout, after, groups)
        for options in self._adam.param_groups:
            options["lr"] = weights.learning_rate
        totals: dict[str, float] = {}
        order = torch.randperm(len(rollout.seen), generator=self._generator).tolist()
        for step in order:
            loss, found = self._loss(rollout, step, advantage[step], target[step], weights)
            self._adam.zero_grad()
            torch.autograd.backward(loss)
            torch.nn.utils.clip_grad_norm_(self._parameters, _MOST_GRADIENT)
            self._adam.step()
            self.updates += 1
            for name, value in found.items():
                totals[name] = totals.get(name, 0.0) + float(value) / len(order)
        self.rollouts += 1
        return totals

    def _targets(
        self, rollout: TeamRollout, after: Relations, groups: int
    ) -> tuple[Tensor, Tensor]:
        """Standardised advantages (T, B) and the critic's targets (T, B)."""
        values = torch.stack([self.values(seen) for seen in (*rollout.seen, after)])
        reward, ended = torch.stack(rollout.rewards), torch.stack(rollout.ended)
        terminated = torch.stack(rollout.terminated)
        # Where a time limit ended an episode, the value before its last step stands for the one
        # after it: nobody sees that state.
        following = torch.where(ended, values[:-1], values[1:])
        advantage = generalised_advantage(
            reward.unsqueeze(1),
            values[:-1].unsqueeze(1),
            following.unsqueeze(1),
            terminated,
            ended,
            self._gamma,
            self._lambda,
        ).squeeze(1)
        returns = advantage + values[:-1]
        self._rescale(returns)
        by_team = advantage.view(len(advantage), groups, -1)
        mean = by_team.mean((0, 2), keepdim=True)
        std = by_team.std((0, 2), keepdim=True)
        standard = ((by_team - mean) / (std + _ADVANTAGE_FLOOR)).view_as(advantage)
        return standard, (returns - self._mean) / self._std

    @torch.no_grad()
    def _rescale(self, returns: Tensor) -> None:
        """Follow mean and deviation of returns; what the critic says stays the same (PopArt)."""
        share = max(_SLOWEST_AVERAGE, 1.0 / (self.rollouts + 1))
        mean = self._mean + (returns.mean() - self._mean) * share
        std = self._std + (returns.std().clamp(min=_RETURN_FLOOR) - self._std) * share
        out = self.critic.out
        out.bias.copy_((out.bias * self._std + self._mean - mean) / std)
        out.weight.mul_(self._std / std)
        self._mean, self._std = mean, std

    def _loss(
        self,
        rollout: TeamRollout,
        step: int,
        advantage: Tensor,
        target: Tensor,
        weights: Weights,
    ) -> tuple[Tensor, dict[str, Tensor]]:
        seen = rollout.seen[step]
        log_probs = self.actor(seen)
        entropy = -(log_probs.exp() * log_probs).sum(1).mean()
        value_error = functional.mse_loss(self.critic(seen), target)
        loss = 0.5 * value_error
        found = {"entropy": entropy, "value_error": value_error}
        if weights.imitation:
            wanted = rollout.wanted[step]
            loss = loss + weights.imitation * functional.nll_loss(log_probs, wanted)
            found["agreement"] = (log_probs.argmax(1) == wanted).float().mean()
        if weights.policy:
            taken = log_probs.gather(1, rollout.actions[step][:, None]).squeeze(1)
            change = taken - rollout.log_probs[step]
            ratio = change.exp()
            size = seen.times.shape[1]
            of_robot = advantage.index_select(0, seen.robot_cells // size)
            clipped = ratio.clamp(1.0 - self._clip, 1.0 + self._clip)
            gain = torch.minimum(ratio * of_robot, clipped * of_robot).mean()
            loss = loss - weights.policy * (gain + weights.entropy * entropy)
            found["kl"] = (ratio - 1.0 - change).mean()
        return loss, {name: value.detach() for name, value in found.items()}
