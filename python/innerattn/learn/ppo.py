"""The on-policy learner: proximal policy optimisation with the same actors and critics.

It decides when to update and how; networks live in `nn`, formulas in `losses` and `advantage`.
Sources: Schulman et al. 2017; the baseline of Iqbal & Sha 2019, section 3.3.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig
from innerattn.learn import losses
from innerattn.learn.actor_critic import ActorCritic, Networks
from innerattn.learn.adam import Forward
from innerattn.learn.advantage import ReturnScale, generalised_advantage
from innerattn.learn.gradients import average_over_robots, clip_norm, clip_norm_by_robot
from innerattn.learn.types import Team, Transitions
from innerattn.nn import sample_actions

_METRICS = (
    "critic_loss",
    "q_mean",
    "critic_grad_norm",
    "actor_loss",
    "policy_entropy",
    "actor_grad_norm",
    "kl",
    "clip_share",
)
_CHUNK = 4096
"""Rows that values are computed for at a time."""


class PPO(ActorCritic):
    """The on-policy learner; its contract is `innerattn.learn.types.Learner`.

    The baseline of robot i does not depend on its own action: with `advantage = "counterfactual"`
    it is sum_a pi_i(a) Q_i(o, a, a_-i), and Q_i of the action taken is fitted to the lambda-return;
    with "value" it is a value head, of the same critic or of one without attention.

    Attributes:
        scale: Running deviation of returns; rewards are divided by it.
    """

    def __init__(
        self,
        team: Team,
        network: NetworkConfig,
        ppo: PPOConfig,
        *,
        seed: int,
        device: torch.device,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """Build networks and optimisers; arguments as in `ActorCritic`, numbers in ``ppo``.

        Raises:
            ValueError: As in `ActorCritic`.
        """
        super().__init__(
            team,
            network,
            learning_rate=ppo.learning_rate,
            final_learning_rate_share=ppo.final_learning_rate_share,
            critic_weight_decay=ppo.critic_weight_decay,
            seed=seed,
            device=device,
            dtype=dtype,
            critic_outputs=None if ppo.advantage == "counterfactual" else 1,
        )
        self._config = ppo
        self._shuffle = torch.Generator().manual_seed(self._data_seed)
        self._steps: list[tuple[Transitions, Tensor]] = []
        self._steps_of_frozen = False
        self.scale = ReturnScale(team.num_robots, ppo.gamma, device)

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Keep one control step of E worlds until the rollout is full; see `Learner.observe`.

        A rollout is of one policy: what a frozen actor did, which something else may have changed
        since, is no part of what a learning one is judged by.
        """
        if self.actor_frozen != self._steps_of_frozen:
            self._steps, self._steps_of_frozen = [], self.actor_frozen
        self._steps.append((batch, truncated))

    def learn(self) -> dict[str, float] | None:
        """Do the epochs of a full rollout, of `rollout_steps` control steps.

        Returns:
            Means over the minibatches done now; None while the rollout is not full. Names as of
            `TD.learn`; `kl` is the mean divergence from the policy that acted, in nats, and
            `clip_share` the share of actions whose ratio was clipped.
        """
        if len(self._steps) < self._config.rollout_steps:
            return None
        rollout = self._rollout()
        self._steps = []
        rows = []
        stop = self._config.stop_at_kl
        for _ in range(self._config.epochs):
            order = torch.randperm(rollout.obs.shape[1], generator=self._shuffle)
            epoch = [
                self.update(rollout.take(chosen.to(self._device)))
                for chosen in torch.split(order, self._config.minibatch_size)
            ]
            rows += epoch
            kl = torch.stack(epoch)[:, _METRICS.index("kl")].mean()
            if stop is not None and float(kl) > stop:
                break
        means = torch.stack(rows).mean(dim=0).tolist()
        return dict(zip(_METRICS, means, strict=True))

    @torch.no_grad()
    def update(self, rows: Rollout) -> Tensor:
        """Update the critic, then the actors, from some rows of a rollout.

        Args:
            rows: At least one row.

        Returns:
            (8,) the values that `learn` names, in that order.
        """
        return self._update(*rows)

    def _update_networks(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        log_prob: Tensor,
        value: Tensor,
        advantage: Tensor,
        target: Tensor,
        rate: Tensor,
    ) -> Tensor:
        critic_figures = self._update_critic(nets, obs, actions, value, target, rate)
        actor_figures = self._update_actor(nets, obs, actions, log_prob, advantage, rate)
        return torch.stack([*critic_figures, *actor_figures])

    def _update_critic(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        before: Tensor,
        target: Tensor,
        rate: Tensor,
    ) -> tuple[Tensor, ...]:
        """One step of the critic towards the targets: loss, mean value, gradient norm."""
        config = self._config

        def loss_of(critic: Forward) -> tuple[Tensor, tuple[Tensor, Tensor]]:
            output = critic(obs, actions, self._available(obs))
            value = self._of_taken(output.q, actions)
            if config.value_clip is None:
                loss = losses.critic_loss(value, target)
            else:
                loss = losses.clipped_value_loss(value, before, target, config.value_clip)
            loss = loss + losses.attention_logit_regularisation(
                output.attended, config.attention_logit_penalty
            )
            return loss, (loss.detach(), value.detach().mean())

        gradients, (loss, mean) = nets.critic.gradients(loss_of)
        average_over_robots(gradients, self._team.num_robots)
        norm = clip_norm(gradients, config.critic_grad_clip)
        nets.critic.step(gradients, rate)
        return loss, mean, norm

    def _update_actor(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        before: Tensor,
        advantage: Tensor,
        rate: Tensor,
    ) -> tuple[Tensor, ...]:
        """One step of the policies: loss, entropy, mean gradient norm, KL, clipped share."""
        config = self._config

        def loss_of(actor: Forward) -> tuple[Tensor, tuple[Tensor, Tensor, Tensor]]:
            log_prob = actor(obs).log_softmax(dim=1)
            taken = losses.gather_actions(log_prob, actions)
            entropy = losses.entropy(log_prob).mean(dim=1)
            surrogate = losses.clipped_policy_loss(taken, before, advantage, config.clip)
            loss = surrogate - config.entropy_weight * entropy.sum()
            return loss, (loss.detach(), entropy.detach().mean(), taken.detach() - before)

        gradients, (loss, entropy, change) = nets.actor.gradients(loss_of)
        norms = clip_norm_by_robot(gradients, config.actor_grad_clip)
        if not self.actor_frozen:
            nets.actor.step(gradients, rate)
        ratio = change.exp()
        kl = (ratio - 1.0 - change).mean()
        clipped = ((ratio - 1.0).abs() > config.clip).to(kl.dtype).mean()
        return loss, entropy, norms.mean(), kl, clipped

    @torch.no_grad()
    def _rollout(self) -> Rollout:
        """What was collected, with advantages, targets and the policy that acted."""
        config = self._config
        batches, cut = zip(*self._steps, strict=True)
        obs = torch.stack([self._robots_first(batch.obs) for batch in batches])  # (T, R, E, D)
        actions = torch.stack([batch.actions.to(self._device).t() for batch in batches])
        reward = torch.stack([batch.reward.to(self._device).t() for batch in batches])
        terminated = torch.stack([batch.terminated.to(self._device) for batch in batches])
        ended = terminated | torch.stack([flags.to(self._device) for flags in cut])
        self.scale.update(reward, ended)
        deviation = self.scale.std(config.return_deviation_floor).unsqueeze(1)
        reward = (reward / deviation).to(self._dtype)

        flat_obs, flat_actions = _rows(obs), _rows(actions)
        log_prob, taken, baseline = self._evaluate(flat_obs, flat_actions)
        value = _steps(baseline, len(batches))
        # Where an episode goes on, the next state's value is the next step's; elsewhere the actions
        # that would have been taken in it are drawn.
        next_value = torch.cat([value[1:], torch.zeros_like(value[:1])])
        drawn = ended.clone()
        drawn[-1] = True
        step, env = drawn.nonzero(as_tuple=True)
        after = torch.stack([self._robots_first(batch.next_obs) for batch in batches])
        after = after[step, :, env].transpose(0, 1)  # (R, n, D)
        logits = self.actor(after)
        next_actions = sample_actions(logits, self._draw(logits.shape))
        next_value[step, :, env] = self._evaluate(after, next_actions)[2].t()
        advantage = generalised_advantage(
            reward, value, next_value, terminated, ended, config.gamma, config.gae_lambda
        )
        target = _rows(advantage + value)
        advantage = _rows(advantage)
        centred = advantage - advantage.mean(dim=1, keepdim=True)
        spread = advantage.std(dim=1, correction=0, keepdim=True)
        return Rollout(
            obs=flat_obs,
            actions=flat_actions,
            log_prob=losses.gather_actions(log_prob, flat_actions),
            value=taken,
            advantage=centred / (spread + 1e-8),
            target=target,
        )

    def _evaluate(self, obs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Log-probabilities (R, A, B), fitted values (R, B) and baselines (R, B) of rows."""
        parts = []
        for some_obs, some_actions in zip(
            torch.split(obs, _CHUNK, dim=1), torch.split(actions, _CHUNK, dim=1), strict=True
        ):
            log_prob = self.actor(some_obs).log_softmax(dim=1)
            q = self.critic(some_obs, some_actions, self._available(some_obs)).q
            if self._config.advantage == "counterfactual":
                baseline = (log_prob.exp() * q).sum(dim=1)
            else:
                baseline = q.squeeze(1)
            parts.append((log_prob, self._of_taken(q, some_actions), baseline))
        log_probs, values, baselines = zip(*parts, strict=True)
        return torch.cat(log_probs, dim=2), torch.cat(values, dim=1), torch.cat(baselines, dim=1)

    def _of_taken(self, q: Tensor, actions: Tensor) -> Tensor:
        """(R, B) the values that are fitted: of the actions taken, or of the state."""
        if self._config.advantage == "counterfactual":
            return losses.gather_actions(q, actions)
        return q.squeeze(1)

    def _running(self) -> dict[str, Tensor]:
        scale = self.scale
        return {
            "scale.count": scale.count,
            "scale.mean": scale.mean,
            "scale.squares": scale.squares,
        }


class Rollout(NamedTuple):
    """Rows of a rollout, robots first.

    Attributes:
        obs: (R, B, D).
        actions: (R, B) int64.
        log_prob: (R, B) of the actions, under the policy that acted.
        value: (R, B) what the critic said.
        advantage: (R, B), of mean 0 and deviation 1 for each robot of the whole rollout.
        target: (R, B) what the critic should have said.
    """

    obs: Tensor
    actions: Tensor
    log_prob: Tensor
    value: Tensor
    advantage: Tensor
    target: Tensor

    def take(self, rows: Tensor) -> Rollout:
        """Some rows, by their numbers (n,) int64."""
        return Rollout._make(tensor[:, rows] for tensor in self)


def _rows(steps: Tensor) -> Tensor:
    """Bring (T, R, E, ...) to (R, T * E, ...)."""
    return steps.transpose(0, 1).flatten(1, 2)


def _steps(rows: Tensor, count: int) -> Tensor:
    """Bring (R, T * E) back to (T, R, E)."""
    return rows.view(len(rows), count, -1).transpose(0, 1)
