"""The off-policy learner: a maximum-entropy actor-critic with attention in the critic.

It decides when and how to update. Networks are in `nn`, formulas in `losses`. Sources: eqs. 2-4 of
the paper and Iqbal & Sha 2019, sections 3.1-3.3 ("MAAC").
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor, nn

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import losses, workers
from innerattn.learn.actor_critic import ActorCritic, Networks
from innerattn.learn.adam import Forward, Network
from innerattn.learn.gradients import average_over_robots, clip_norm, clip_norm_by_robot
from innerattn.learn.replay import Replay
from innerattn.learn.resume import State, inside, take_whole, under, whole
from innerattn.learn.ring import Ring
from innerattn.learn.types import Scheduled, Team, Transitions
from innerattn.nn import sample_actions

_TARGETS = {"consistent": losses.consistent_target, "maac": losses.maac_target}
_POLICY_LOSSES = {
    "expected": losses.expected_policy_loss,
    "sampled": losses.sampled_policy_loss,
}
_METRICS = (
    "critic_loss",
    "q_mean",
    "critic_grad_norm",
    "actor_loss",
    "policy_entropy",
    "actor_grad_norm",
)


@dataclass(frozen=True)
class TDNetworks(Networks):
    """The networks of an update, and their slow copies, which give the targets."""

    target_actor: Network
    target_critic: Network


class TD(ActorCritic):
    """The off-policy learner; its contract is `innerattn.learn.types.Learner`.

    Attributes:
        target_actor: Slow copy of the policies.
        target_critic: Slow copy of the critics.
    """

    _metric_names = _METRICS

    def __init__(
        self,
        team: Team,
        network: NetworkConfig,
        td: TDConfig,
        *,
        seed: int,
        device: torch.device,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """Build networks and optimisers.

        Args:
            team: What is known of the team.
            network: Sizes and kind of the networks.
            td: Numbers of the algorithm.
            seed: Seed of the initial weights and of every draw.
            device: Where networks and replay live.
            dtype: Floating-point type of the networks.

        Raises:
            ValueError: As in `ActorCritic`.
        """
        super().__init__(
            team,
            network,
            learning_rate=td.learning_rate,
            final_learning_rate_share=td.final_learning_rate_share,
            critic_weight_decay=td.critic_weight_decay,
            seed=seed,
            device=device,
            dtype=dtype,
        )
        self._config = td
        self._temperature = 1.0 / td.reward_scale
        self._gamma = td.gamma
        self._target_form = _TARGETS[td.entropy_target]
        self._policy_loss = _POLICY_LOSSES[td.policy_gradient]
        self.target_actor = copy.deepcopy(self.actor).requires_grad_(False)
        self.target_critic = copy.deepcopy(self.critic).requires_grad_(False)
        self._networks: TDNetworks = TDNetworks(
            self._actor_adam,
            self._critic_adam,
            Network(self.target_actor),
            Network(self.target_critic),
        )
        self._pending_env_steps = 0

    @cached_property
    def replay(self) -> Replay:
        """Past transitions; who only acts never asks for them, and needs no memory for them.

        Raises:
            MemoryError: There is not that much.
        """
        return self._new_replay(1)

    def follow(self, scheduled: Scheduled) -> None:
        """Take over discount, temperature and weights of rewards; see `ScheduledLearner.follow`."""
        if scheduled.gamma is not None:
            self._gamma = scheduled.gamma
        if scheduled.entropy_weight is not None:
            self._temperature = scheduled.entropy_weight
        weights = scheduled.reward_weights
        if weights is not None:
            if self.replay.parts != len(weights):
                self.replay = self._new_replay(len(weights))
            self.replay.weigh(weights)

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Store one control step of E worlds; see `Learner.observe`."""
        del truncated  # a time limit is no termination: the target looks past it
        self.replay.add(batch)
        warm = workers.share_of(self._config.warmup_env_steps)
        if len(self.replay) >= min(warm, self.replay.capacity):
            self._pending_env_steps += len(batch.obs) * workers.count()

    @torch.no_grad()
    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        """Train the policies, and set their slow copies to them; see `Learner.imitate`.

        The critic's targets are then those of the policies that imitate.
        """
        loss = super().imitate(obs, actions, learning_rate)
        self._networks.target_actor.flat.copy_(self._networks.actor.flat)
        return loss

    def learn(self) -> dict[str, float] | None:
        """Do one update for every `update_every_env_steps` env-steps since the warm-up.

        Returns:
            Means over the updates done now; None when none was due. `critic_loss` and `actor_loss`
            are summed over robots, `q_mean` is of the actions taken, `policy_entropy` is in nats;
            `critic_grad_norm` and `actor_grad_norm` (its mean over robots) are before clipping.
        """
        every = self._config.update_every_env_steps
        size = workers.share_of(self._config.batch_size)
        while self._pending_env_steps >= every:
            self._do_update(size, lambda: self.update(self.replay.sample(size)))
            self._pending_env_steps -= every
        return self._take_metrics()

    @torch.no_grad()
    def update(self, batch: Transitions) -> Tensor:
        """Update the critic, then the actors by the new critic, then the target networks.

        Args:
            batch: At least one transition. Rewards are divided by their standard deviation in the
                replay; where no episode terminates, their mean is taken off before.

        Returns:
            (6,) the metrics that `learn` names, in that order.
        """
        floor = self._config.reward_std_floor
        reward = batch.reward.to(self._device)
        mean, std = self.replay.reward_moments()
        if not self._team.terminates:  # else a policy would be paid for the length of its episodes
            reward = reward - mean
        reward = reward / std.clamp_min(floor)
        continues = ~batch.terminated.to(self._device)
        shape = (self._team.num_robots, self._team.num_actions, len(batch.obs))
        return self._update(
            self._robots_first(batch.obs),
            batch.actions.to(self._device).t(),
            reward.t().to(self._dtype),
            self._robots_first(batch.next_obs),
            self._gamma * continues.to(self._dtype),
            self._draw(shape),
            self._draw(shape),
            self._number(self._temperature),
        )

    def rings(self) -> dict[str, Ring]:
        """The rows of the replay; see `ResumableLearner.rings`."""
        return {"replay": self.replay.ring}

    def resume_state(self) -> dict[str, Tensor]:
        """All but `state` and `rings`; see `ResumableLearner`."""
        replay = under("replay", self.replay.resume_state())
        return self._resume_state() | replay | {"pending": whole(self._pending_env_steps)}

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `ResumableLearner`."""
        self._load_resume_state(state)
        self.replay.load_resume_state(inside("replay", state))
        self._pending_env_steps = take_whole(state, "pending")

    def _generators(self) -> list[torch.Generator]:
        return [*super()._generators(), self.replay.generator]

    def _new_replay(self, reward_parts: int) -> Replay:
        capacity = workers.share_of(self._config.replay_capacity)
        try:
            return Replay(capacity, self._team, self._data_seed, self._device, reward_parts)
        except MemoryError as error:
            key = f"td.replay_capacity = {self._config.replay_capacity}"
            raise MemoryError(f"{key}: {error}") from error

    def _update_networks(
        self,
        nets: TDNetworks,
        obs: Tensor,
        actions: Tensor,
        reward: Tensor,
        next_obs: Tensor,
        discount: Tensor,
        next_noise: Tensor,
        noise: Tensor,
        temperature: Tensor,
        rate: Tensor,
    ) -> Tensor:
        target = self._targets(nets, reward, next_obs, discount, next_noise, temperature)
        critic_metrics = self._update_critic(nets, obs, actions, target, rate)
        actor_metrics = self._update_actor(nets, obs, noise, temperature, rate)
        for slow, fast in ((nets.target_actor, nets.actor), (nets.target_critic, nets.critic)):
            slow.flat.lerp_(fast.flat, self._config.polyak)
        return torch.stack([*critic_metrics, *actor_metrics])

    def _targets(
        self,
        nets: TDNetworks,
        reward: Tensor,
        next_obs: Tensor,
        discount: Tensor,
        noise: Tensor,
        temperature: Tensor,
    ) -> Tensor:
        """The targets (R, B) of a batch; the next actions are drawn from the target policy."""
        log_prob = nets.target_actor(next_obs).log_softmax(dim=1)
        actions = sample_actions(log_prob, noise)
        q = nets.target_critic(next_obs, actions, self._available(next_obs)).q
        entropy_term = temperature * losses.gather_actions(log_prob, actions)
        next_value = losses.gather_actions(q, actions)
        return self._target_form(reward, next_value, entropy_term, discount)

    def _update_critic(
        self, nets: TDNetworks, obs: Tensor, actions: Tensor, target: Tensor, rate: Tensor
    ) -> tuple[Tensor, ...]:
        """One step of the critic towards the targets: loss, mean value, gradient norm."""
        config = self._config

        def loss_of(critic: Forward) -> tuple[Tensor, tuple[Tensor, Tensor]]:
            output = critic(obs, actions, self._available(obs))
            q_taken = losses.gather_actions(output.q, actions)
            loss = losses.critic_loss(q_taken, target)
            loss = loss + losses.attention_logit_regularisation(
                output.attended, config.attention_logit_penalty
            )
            return loss, (loss.detach(), q_taken.detach().mean())

        found, numbers = nets.critic.gradients(loss_of)
        (gradients,), (loss, q_mean) = self._averaged({"critic": found}, numbers)
        average_over_robots(gradients, self._team.num_robots, self._robots_of_each_kind)
        norm = clip_norm(gradients, config.critic_grad_clip)
        nets.critic.step(gradients, rate)
        return loss, q_mean, norm

    def _update_actor(
        self, nets: TDNetworks, obs: Tensor, noise: Tensor, temperature: Tensor, rate: Tensor
    ) -> tuple[Tensor, ...]:
        """One step of the policies by the new critic: loss, entropy, mean gradient norm."""

        def loss_of(actor: Forward) -> tuple[Tensor, tuple[Tensor, Tensor]]:
            log_prob = actor(obs).log_softmax(dim=1)
            with torch.no_grad():
                actions = sample_actions(log_prob, noise)
                q = nets.critic(obs, actions, self._available(obs)).q
                entropy = losses.entropy(log_prob).mean()
            loss = self._policy_loss(log_prob, q, actions, temperature)
            return loss, (loss.detach(), entropy)

        found, numbers = nets.actor.gradients(loss_of)
        (gradients,), (loss, entropy) = self._averaged({"actor": found}, numbers)
        average_over_robots(gradients, self._team.num_robots, self._robots_of_each_kind)
        norms = clip_norm_by_robot(gradients, self._config.actor_grad_clip)
        if not self.actor_frozen:
            nets.actor.step(gradients, rate)
        return loss, entropy, norms.mean()

    def _modules(self) -> dict[str, nn.Module]:
        targets = {"target_actor": self.target_actor, "target_critic": self.target_critic}
        return super()._modules() | targets
