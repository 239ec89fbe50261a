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
from innerattn.learn.advantage import ReturnScale, generalised_advantage
from innerattn.learn.afterstate import AfterstateCritic
from innerattn.learn.clipped_update import METRICS, ClippedUpdate, recalls
from innerattn.learn.networks import draw_networks
from innerattn.learn.recall import Recall
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
from innerattn.learn.rollout import (
    Rollout,
    RolloutBuffer,
    in_sequences,
    rows_of,
    standardised,
    steps_of,
)
from innerattn.learn.types import Scheduled, Team, Transitions

_CHUNK = 1024
"""Rows whose values are computed at a time."""
_CHUNK_BY_ENTITY = 4096
"""The same, in rows of single robots, where encoders go by entity and take far more memory."""


@dataclass
class _Passes:
    """The passes over a rollout, as far as they are done.

    Attributes:
        rollout: What is trained on.
        epoch: Passes that are done.
        order: (B,) the rows of the present pass in their order, or (S,) the sequences; None before
            it has begun.
        done: Minibatches of the present pass that are done.
        learnt: Those of them that were learnt from.
    """

    rollout: Rollout
    epoch: int = 0
    order: Tensor | None = None
    done: int = 0
    learnt: int = 0


class PPO(ClippedUpdate):
    """The on-policy learner; its contract is `innerattn.learn.types.Learner`.

    The baseline of robot i does not depend on its own action. With `advantage = "counterfactual"`
    it is ``sum_a pi_i(a) Q_i(o, a, a_-i)``, and Q_i of the action taken is fitted to the
    lambda-return. With "value" it is a value head, of the same critic or of one without attention.

    Attributes:
        scale: Running standard deviation of returns, by which rewards are divided.
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
        self._memory_width = 2 * network.memory_width  # of actor and critic
        self._team_of_rows = team
        if self._messages is not None:  # which are made of more than an observation
            self._team_of_rows = team._replace(obs_width=self._messages.width)
        self._buffer = RolloutBuffer(
            ppo.rollout_steps, self._team_of_rows, device, dtype, self._memory_width
        )
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
        log_probs = self._log_probs_of(batch.obs)
        self._see(batch)
        memories = self._memories
        remembered = None if memories is None else (memories.before, memories.now)
        self._buffer.add(self._in_rows(batch), truncated, log_probs, remembered)
        if memories is not None:
            memories.forget(batch.terminated | truncated)

    @torch.no_grad()
    def _see(self, batch: Transitions) -> None:
        """Let robots remember, and say, what they saw where others acted for them."""
        if self._memories is None and self._messages is None:
            return
        if self._acted is None or self._acted[0] is not batch.obs:
            self._outputs(batch.obs, batch.elements)

    def _in_rows(self, batch: Transitions) -> Transitions:
        """The same with the rows of policies with messages in the place of observations."""
        if self._messages is None:
            return batch
        after = self._robots_first(batch.next_obs), self._turned_by(batch.next_elements)
        rows = self._messages.now, self._messages.after_step(*after)
        obs, next_obs = (one.transpose(0, 1) for one in rows)
        return batch._replace(obs=obs, next_obs=next_obs)

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
            passes.order = torch.randperm(rollout.units, generator=self._shuffle)
        rows_of_unit = rollout.obs.shape[1] // rollout.units
        size = max(1, self._config.minibatch_size // rows_of_unit)
        minibatches = _split(passes.order, size, workers.count())
        for chosen in minibatches[passes.done :]:
            rows = rollout.take(chosen.to(self._device))
            passes.learnt += self._do_update(rows.obs.shape[1], partial(self.update, rows))
            passes.done += 1
        found = self._rows[len(self._rows) - passes.learnt :]
        passes.epoch, passes.order, passes.done, passes.learnt = passes.epoch + 1, None, 0, 0
        stop = self._config.stop_at_kl
        if stop is None or not found or self.actor_frozen:  # imitation changes a frozen policy
            return False
        return float(torch.stack(found)[:, METRICS.index("kl")].mean()) > stop

    @torch.no_grad()
    def _rollout(self) -> Rollout:
        """The collected steps with their advantages, targets and log-probabilities."""
        config = self._config
        steps = self._buffer.steps()
        self.scale.update(steps.reward, steps.ended)
        scale = self.scale.std(config.return_deviation_floor).unsqueeze(1)
        reward = (steps.reward / scale).to(self._dtype)

        log_prob, baseline = self._evaluate(steps.obs, steps.actions, steps.recall, steps.log_probs)
        value = steps_of(baseline, len(reward))
        # Within an episode, the value of the next state is that of the next step. After its last
        # step, and after the last of the rollout, it takes actions drawn for that state.
        next_value = torch.cat([value[1:], torch.zeros_like(value[:1])])
        step, env = steps.cut.nonzero(as_tuple=True)
        outputs = self.actor(steps.after, *recalls(steps.after_recall)[0])
        next_actions = self._actions.draw(outputs, self._noise)
        _, later = self._evaluate(steps.after, next_actions, steps.after_recall)
        next_value[step, :, env] = later.t()
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
        rollout = Rollout(
            obs=steps.obs,
            actions=steps.actions,
            log_prob=log_prob,
            # Rewards that never differ say nothing: advantages are then errors of the critic.
            advantage=standardised(rows_of(advantage)) * self.scale.has_spread().unsqueeze(1),
            target=rows_of(advantage + value),
        )
        if self._memories is None:
            return rollout
        return in_sequences(rollout, steps, self._config.sequence_steps)

    def _evaluate(
        self,
        obs: Tensor,
        actions: Tensor,
        recall: Recall | None,
        log_probs: Tensor | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Log-probabilities of the actions and baselines of rows, (R, B) each.

        Args:
            obs: (R, B, D).
            actions: (R, B) int64, or (R, B, W).
            recall: What robots remembered before each row; None without a memory.
            log_probs: (R, A, B) of all discrete actions, if they are known.
        """
        parts = []
        rows = max(1, _CHUNK_BY_ENTITY // len(obs)) if self._by_entity else _CHUNK
        for first in range(0, obs.shape[1], rows):
            chunk = slice(first, first + rows)
            some_obs, some_actions = self._laid_out(obs[:, chunk]), actions[:, chunk]
            of_actor, of_critic = recalls(None if recall is None else recall.steps(chunk))
            seen, available = self._seen_in(some_obs), self._available(some_obs)
            q = self.critic(seen, some_actions, available, *of_critic).q
            if self._team.action_width:
                taken = self._actions.log_prob(self.actor(some_obs, *of_actor), some_actions)
                baseline = q.squeeze(1)
            else:
                if log_probs is None:
                    log_prob = self.actor(some_obs, *of_actor).log_softmax(dim=1)
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
        if self._memories is not None:
            state |= under("memories", self._memories.resume_state())
        if self._messages is not None:
            state |= under("messages", self._messages.resume_state())
        if self._passes is not None:
            passes = self._passes
            state |= under("rollout", passes.rollout.resume_state())
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
        if self._memories is not None:
            self._memories.load_resume_state(inside("memories", state))
        if self._messages is not None:
            self._messages.load_resume_state(inside("messages", state))
        self._passes = None
        if "epoch" in state:
            found, like = inside("rollout", state), self._number(0.0)
            rollout = Rollout.taken_from(found, self._team_of_rows, like, self._memory_width)
            size = rollout.units
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
