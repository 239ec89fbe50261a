"""One update of PPO from some rows of a rollout: the critic, then the actors.

Formulas are in `losses`. Sources: Schulman et al. 2017; the baseline of Iqbal & Sha 2019,
section 3.3.
"""

from __future__ import annotations

import torch
from torch import Tensor

from innerattn.config import PPOConfig
from innerattn.learn import losses
from innerattn.learn.actor_critic import ActorCritic, Networks
from innerattn.learn.adam import Forward, Gradients
from innerattn.learn.gradients import average_over_robots, clip_norm, clip_norm_by_robot
from innerattn.learn.memories import parts_of
from innerattn.learn.recall import Recall
from innerattn.learn.rollout import Rollout

METRICS = (
    "critic_loss",
    "q_mean",
    "critic_grad_norm",
    "actor_loss",
    "policy_entropy",
    "actor_grad_norm",
    "kl",
    "clip_share",
)
Recalled = tuple[Tensor | None, ...]
"""What a network with a memory takes last: past, begins and turns; nothing without a memory."""


class ClippedUpdate(ActorCritic):
    """A learner that is updated with the clipped objective. A subclass says from what and when."""

    _metric_names = METRICS
    _config: PPOConfig
    _entropy_weight: float

    @torch.no_grad()
    def update(self, rows: Rollout) -> Tensor:
        """Update the critic, then the actors, from some rows of a rollout.

        Args:
            rows: At least one row.

        Returns:
            (8,) the metrics that `learn` names, in that order.
        """
        rows = rows._replace(obs=self._laid_out(rows.obs))
        return self._update(*rows.tensors(), self._number(self._entropy_weight))

    def _update_networks(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        log_prob: Tensor,
        advantage: Tensor,
        target: Tensor,
        remembered: Tensor | None,
        begins: Tensor | None,
        turns: Tensor | None,
        entropy_weight: Tensor,
        rate: Tensor,
    ) -> Tensor:
        recall = None if remembered is None else Recall(remembered, begins, turns)
        actor_recall, critic_recall = recalls(recall)
        of_critic, (critic_loss, q_mean) = self._critic_gradients(
            nets, obs, actions, target, critic_recall
        )
        of_actor, found = self._actor_gradients(
            nets, obs, actions, log_prob, advantage, entropy_weight, actor_recall
        )
        (of_critic, of_actor), numbers = self._averaged(
            {"critic": of_critic, "actor": of_actor}, [critic_loss, q_mean, *found]
        )
        critic_loss, q_mean, actor_loss, entropy, kl, clipped = numbers
        critic_norm = self._step_critic(nets, of_critic, rate)
        actor_norm = self._step_actor(nets, of_actor, rate)
        return torch.stack(
            [critic_loss, q_mean, critic_norm, actor_loss, entropy, actor_norm, kl, clipped]
        )

    def _critic_gradients(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        target: Tensor,
        recall: Recalled,
    ) -> tuple[Gradients, tuple[Tensor, Tensor]]:
        """Gradients of the critic towards the targets; its loss and mean value."""
        config = self._config

        def loss_of(critic: Forward) -> tuple[Tensor, tuple[Tensor, Tensor]]:
            output = critic(self._seen_in(obs), actions, self._available(obs), *recall)
            value = self._fitted(output.q, actions)
            loss = losses.critic_loss(value, target)
            loss = loss + losses.attention_logit_regularisation(
                output.attended, config.attention_logit_penalty
            )
            return loss, (loss.detach(), value.detach().mean())

        found: tuple[Gradients, tuple[Tensor, Tensor]] = nets.critic.gradients(loss_of)
        return found

    def _step_critic(self, nets: Networks, gradients: Gradients, rate: Tensor) -> Tensor:
        """One step of the critic; () the norm of its gradient."""
        average_over_robots(gradients, self._team.num_robots, self._robots_of_each_kind)
        norm = clip_norm(gradients, self._config.critic_grad_clip)
        nets.critic.step(gradients, rate)
        return norm

    def _actor_gradients(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        before: Tensor,
        advantage: Tensor,
        entropy_weight: Tensor,
        recall: Recalled,
    ) -> tuple[Gradients, tuple[Tensor, Tensor, Tensor, Tensor]]:
        """Gradients of the policies; their loss, entropy, KL and clipped share."""
        config = self._config

        def loss_of(actor: Forward) -> tuple[Tensor, tuple[Tensor, Tensor, Tensor]]:
            taken, entropies = self._actions.scored(actor(obs, *recall), actions)
            entropy = entropies.mean(dim=1)
            surrogate = losses.clipped_policy_loss(taken, before, advantage, config.clip)
            loss = surrogate - entropy_weight * entropy.sum()
            return loss, (loss.detach(), entropy.detach().mean(), taken.detach() - before)

        gradients, (loss, entropy, change) = nets.actor.gradients(loss_of)
        ratio = change.exp()
        kl = (ratio - 1.0 - change).mean()
        clipped = ((ratio - 1.0).abs() > config.clip).to(kl.dtype).mean()
        return gradients, (loss, entropy, kl, clipped)

    def _step_actor(self, nets: Networks, gradients: Gradients, rate: Tensor) -> Tensor:
        """One step of the policies, unless they are frozen; () the mean norm of their gradients."""
        average_over_robots(gradients, self._team.num_robots, self._robots_of_each_kind)
        norms = clip_norm_by_robot(gradients, self._config.actor_grad_clip)
        if not self.actor_frozen:
            nets.actor.step(gradients, rate)
        return norms.mean()

    def _fitted(self, q: Tensor, actions: Tensor) -> Tensor:
        """(R, B) the values that are fitted to targets: of the actions taken, or of the state."""
        if self._config.advantage == "counterfactual":
            return losses.gather_actions(q, actions)
        return q.squeeze(1)


def recalls(recall: Recall | None) -> tuple[Recalled, Recalled]:
    """What actors and critics remember, of what both do."""
    if recall is None:
        return (), ()
    of_actor, of_critic = parts_of(recall.remembered)
    return (of_actor, *recall[1:]), (of_critic, *recall[1:])
