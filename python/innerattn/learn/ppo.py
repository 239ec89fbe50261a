"""The on-policy learner: proximal policy optimisation with the same actors and critics.

It decides when and how to update. Networks are in `nn`, formulas in `losses` and `advantage`.
Sources: Schulman et al. 2017; the baseline of Iqbal & Sha 2019, section 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig
from innerattn.learn import losses, workers
from innerattn.learn.actor_critic import ActorCritic, Networks
from innerattn.learn.adam import Forward, Gradients
from innerattn.learn.advantage import ReturnScale, generalised_advantage
from innerattn.learn.afterstate import AfterstateCritic
from innerattn.learn.gradients import average_over_robots, clip_norm, clip_norm_by_robot
from innerattn.learn.networks import draw_networks
from innerattn.learn.resume import (
    State,
    inside,
    take_generator,
    take_whole,
    take_within,
    under,
    whole,
)
from innerattn.learn.ring import Ring
from innerattn.learn.rollout import Rollout, RolloutBuffer, rows_of, standardised, steps_of
from innerattn.learn.types import Scheduled, Team, Transitions

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
_CHUNK = 1024
"""Rows whose values are computed at a time."""


@dataclass
class _Passes:
    """The passes over a rollout, as far as they are done.

    Attributes:
        rollout: What is trained on.
        epoch: Passes that are done.
        order: (B,) the rows of the present pass in their order; None before it has begun.
        done: Minibatches of the present pass that are done.
        learnt: Those of them that were learnt from.
    """

    rollout: Rollout
    epoch: int = 0
    order: Tensor | None = None
    done: int = 0
    learnt: int = 0


class PPO(ActorCritic):
    """The on-policy learner; its contract is `innerattn.learn.types.Learner`.

    The baseline of robot i does not depend on its own action. With `advantage = "counterfactual"`
    it is ``sum_a pi_i(a) Q_i(o, a, a_-i)``, and Q_i of the action taken is fitted to the
    lambda-return. With "value" it is a value head, of the same critic or of one without attention.

    Attributes:
        scale: Running standard deviation of returns, by which rewards are divided.
    """

    _metric_names = _METRICS

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
            ValueError: As in `ActorCritic`, or continuous actions have no counterfactual baseline,
                or states have no columns that `ppo.bootstrap` needs.
        """
        if ppo.bootstrap == "afterstate" and not team.state_width:
            raise ValueError(f"state_width = 0: ppo.bootstrap = {ppo.bootstrap!r} needs a state")
        if team.action_width and ppo.advantage != "value":
            raise ValueError(f"ppo.advantage = {ppo.advantage!r}: continuous actions need 'value'")
        outputs = None if ppo.advantage == "counterfactual" else 1
        super().__init__(
            team,
            network,
            learning_rate=ppo.learning_rate,
            final_learning_rate_share=ppo.final_learning_rate_share,
            critic_weight_decay=ppo.critic_weight_decay,
            seed=seed,
            device=device,
            dtype=dtype,
            draw=partial(draw_networks, critic_outputs=outputs),
        )
        self._config = ppo
        self._shuffle = torch.Generator().manual_seed(self._data_seed)
        self._buffer = RolloutBuffer(ppo.rollout_steps, team, device, dtype)
        self._steps_of_frozen = False
        self._afterstates: AfterstateCritic | None = None
        if ppo.bootstrap == "afterstate":
            sizes = team.state_width, team.num_robots, network.hidden_width
            self._afterstates = AfterstateCritic(sizes, ppo, seed=seed, device=device, dtype=dtype)
        self._passes: _Passes | None = None
        self._gamma, self._entropy_weight = ppo.gamma, ppo.entropy_weight
        self.scale = ReturnScale(team.num_robots, ppo.gamma, device)

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Keep one control step of E worlds until the rollout is full; see `Learner.observe`.

        A rollout belongs to one policy. Steps of a frozen actor are dropped once the actor learns,
        because imitation may have changed the policy since, and the other way round.
        """
        if self.actor_frozen != self._steps_of_frozen:
            self._buffer.clear()
            self.scale.forget_open_returns()
            self._steps_of_frozen = self.actor_frozen
        self._buffer.add(batch, truncated, self._log_probs_of(batch.obs))

    def follow(self, scheduled: Scheduled) -> None:
        """Take over discount and entropy weight; see `ScheduledLearner.follow`."""
        if scheduled.gamma is not None:
            self._gamma = self.scale.gamma = scheduled.gamma
        if scheduled.entropy_weight is not None:
            self._entropy_weight = scheduled.entropy_weight

    def learn(self) -> dict[str, float] | None:
        """Train on a full rollout, of `rollout_steps` control steps, for `epochs` passes.

        Returns:
            Means over the minibatches done now; None while the rollout is not full. Names are those
            of `TD.learn`, and `kl`, the mean divergence from the policy that acted [nats], and
            `clip_share`, the share of actions whose ratio was clipped.
        """
        if self._passes is None:
            if not self._buffer.full:
                return None
            self._passes = _Passes(self._rollout())
            self._buffer.clear()
        while self._passes.epoch < self._config.epochs:
            if self._pass(self._passes):
                break
        self._passes = None
        return self._take_metrics()

    def _pass(self, passes: _Passes) -> bool:
        """Do the rest of the present pass.

        Returns:
            Whether it is to be the last.
        """
        rollout = passes.rollout
        if passes.order is None:
            passes.order = torch.randperm(rollout.obs.shape[1], generator=self._shuffle)
        minibatches = _split(passes.order, self._config.minibatch_size, workers.count())
        for chosen in minibatches[passes.done :]:
            rows = rollout.take(chosen.to(self._device))
            passes.learnt += self._do_update(len(chosen), partial(self.update, rows))
            passes.done += 1
        found = self._rows[len(self._rows) - passes.learnt :]
        passes.epoch, passes.order, passes.done, passes.learnt = passes.epoch + 1, None, 0, 0
        stop = self._config.stop_at_kl
        if stop is None or not found or self.actor_frozen:  # imitation changes a frozen policy
            return False
        return float(torch.stack(found)[:, _METRICS.index("kl")].mean()) > stop

    @torch.no_grad()
    def update(self, rows: Rollout) -> Tensor:
        """Update the critic, then the actors, from some rows of a rollout.

        Args:
            rows: At least one row.

        Returns:
            (8,) the metrics that `learn` names, in that order.
        """
        return self._update(*rows, self._number(self._entropy_weight))

    def _update_networks(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        log_prob: Tensor,
        advantage: Tensor,
        target: Tensor,
        entropy_weight: Tensor,
        rate: Tensor,
    ) -> Tensor:
        of_critic, (critic_loss, q_mean) = self._critic_gradients(nets, obs, actions, target)
        of_actor, found = self._actor_gradients(
            nets, obs, actions, log_prob, advantage, entropy_weight
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
        self, nets: Networks, obs: Tensor, actions: Tensor, target: Tensor
    ) -> tuple[Gradients, tuple[Tensor, Tensor]]:
        """Gradients of the critic towards the targets; its loss and mean value."""
        config = self._config

        def loss_of(critic: Forward) -> tuple[Tensor, tuple[Tensor, Tensor]]:
            output = critic(obs, actions, self._available(obs))
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
    ) -> tuple[Gradients, tuple[Tensor, Tensor, Tensor, Tensor]]:
        """Gradients of the policies; their loss, entropy, KL and clipped share."""
        config = self._config

        def loss_of(actor: Forward) -> tuple[Tensor, tuple[Tensor, Tensor, Tensor]]:
            taken, entropies = self._actions.scored(actor(obs), actions)
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

    @torch.no_grad()
    def _rollout(self) -> Rollout:
        """The collected steps with their advantages, targets and log-probabilities."""
        config = self._config
        steps = self._buffer.steps()
        self.scale.update(steps.reward, steps.ended)
        scale = self.scale.std(config.return_deviation_floor).unsqueeze(1)
        reward = (steps.reward / scale).to(self._dtype)

        log_prob, baseline = self._evaluate(steps.obs, steps.actions, steps.log_probs)
        value = steps_of(baseline, len(reward))
        # Within an episode, the value of the next state is that of the next step. After its last
        # step, and after the last of the rollout, it takes actions drawn for that state.
        next_value = torch.cat([value[1:], torch.zeros_like(value[:1])])
        step, env = steps.cut.nonzero(as_tuple=True)
        next_actions = self._actions.draw(self.actor(steps.after), self._noise)
        next_value[step, :, env] = self._evaluate(steps.after, next_actions)[1].t()
        if self._afterstates is not None and steps.arrivals is not None:
            next_value = self._afterstates.replaced(steps.arrivals, next_value, self._rate)
        advantage = generalised_advantage(
            reward,
            value,
            next_value,
            steps.terminated,
            steps.ended,
            self._gamma,
            config.gae_lambda,
        )
        return Rollout(
            obs=steps.obs,
            actions=steps.actions,
            log_prob=log_prob,
            # Rewards that never differ say nothing: advantages are then errors of the critic.
            advantage=standardised(rows_of(advantage)) * self.scale.has_spread().unsqueeze(1),
            target=rows_of(advantage + value),
        )

    def _evaluate(
        self, obs: Tensor, actions: Tensor, log_probs: Tensor | None = None
    ) -> tuple[Tensor, Tensor]:
        """Log-probabilities of the actions and baselines of rows, (R, B) each.

        Args:
            obs: (R, B, D).
            actions: (R, B) int64, or (R, B, W).
            log_probs: (R, A, B) of all discrete actions, if they are known.
        """
        parts = []
        for first in range(0, obs.shape[1], _CHUNK):
            chunk = slice(first, first + _CHUNK)
            some_obs, some_actions = obs[:, chunk], actions[:, chunk]
            q = self.critic(some_obs, some_actions, self._available(some_obs)).q
            if self._team.action_width:
                taken = self._actions.log_prob(self.actor(some_obs), some_actions)
                baseline = q.squeeze(1)
            else:
                if log_probs is None:
                    log_prob = self.actor(some_obs).log_softmax(dim=1)
                else:
                    log_prob = log_probs[:, :, chunk]
                taken = losses.gather_actions(log_prob, some_actions)
                if self._config.advantage == "counterfactual":
                    baseline = (log_prob.exp() * q).sum(dim=1)
                else:
                    baseline = q.squeeze(1)
            parts.append((taken, baseline))
        taken, baselines = (torch.cat(found, dim=1) for found in zip(*parts, strict=True))
        return taken, baselines

    def _fitted(self, q: Tensor, actions: Tensor) -> Tensor:
        """(R, B) the values that are fitted to targets: of the actions taken, or of the state."""
        if self._config.advantage == "counterfactual":
            return losses.gather_actions(q, actions)
        return q.squeeze(1)

    def rings(self) -> dict[str, Ring]:
        """None: a rollout is small; see `ResumableLearner.rings`."""
        return {}

    def resume_state(self) -> dict[str, Tensor]:
        """All but `state`; see `ResumableLearner`."""
        state = self._resume_state() | {
            "shuffle": self._shuffle.get_state(),
            "frozen": whole(self._steps_of_frozen),
            **under("scale", self.scale.resume_state()),
            **under("buffer", self._buffer.resume_state()),
        }
        if self._afterstates is not None:
            state |= under("afterstates", self._afterstates.resume_state())
        if self._passes is not None:
            passes = self._passes
            state |= under("rollout", passes.rollout._asdict())
            state |= {"epoch": whole(passes.epoch), "done": whole(passes.done)}
            state |= {"learnt": whole(passes.learnt)}
            state |= {} if passes.order is None else {"order": passes.order}
        return state

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `ResumableLearner`."""
        self._load_resume_state(state)
        take_generator(state, "shuffle", self._shuffle)
        self._steps_of_frozen = bool(take_whole(state, "frozen", 0, 1))
        self.scale.load_resume_state(inside("scale", state))
        self._buffer.load_resume_state(inside("buffer", state))
        if self._afterstates is not None:
            self._afterstates.load_resume_state(inside("afterstates", state))
        self._passes = None
        if "epoch" in state:
            rollout = Rollout.taken_from(inside("rollout", state), self._team, self._number(0.0))
            size = rollout.obs.shape[1]
            self._passes = _Passes(rollout, take_whole(state, "epoch", 0, self._config.epochs))
            if "order" in state:
                self._passes.order = take_within(state, "order", torch.int64, 0, size - 1, size)
                self._passes.done = take_whole(state, "done", 0, size)
                most = min(self._passes.done, len(self._rows))
                self._passes.learnt = take_whole(state, "learnt", 0, most)

    def _running(self) -> dict[str, Tensor]:
        return {f"scale.{name}": tensor for name, tensor in self.scale.tensors().items()}


def _split(order: Tensor, size: int, count: int = 1) -> tuple[Tensor, ...]:
    """Parts, of at most ``size`` rows over all ``count`` workers, that differ by one row at most.

    The few rows of a short last part would weigh as much as all rows of another part.
    """
    return torch.tensor_split(order, -(-len(order) * count // size))
