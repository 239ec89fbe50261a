"""Independent PPO: every robot learns by itself, and its critic sees its own observation only.

Source: de Witt et al. 2020, "Is Independent Learning All You Need in the StarCraft Multi-Agent
Challenge?".
"""

from functools import partial

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.config import NetworkConfig
from innerattn.learn import losses
from innerattn.learn.actor_critic import ActorCritic, Networks
from innerattn.learn.adam import Forward
from innerattn.learn.advantage import ReturnScale, generalised_advantage
from innerattn.learn.gradients import clip_norm_by_robot
from innerattn.learn.rollout import Rollout, RolloutBuffer, rows_of, standardised, steps_of
from innerattn.learn.types import Team, Transitions
from innerattn.nn import Actor, CriticOutput, PerRobotLinear
from ippo import IPPOConfig

METRICS = ("critic_loss", "value_mean", "actor_loss", "policy_entropy", "clip_share")


class OwnCritic(nn.Module):
    """The critics of all robots: each maps its robot's observation to one value."""

    def __init__(self, team: Team, width: int, generator: torch.Generator) -> None:
        super().__init__()
        self.first = PerRobotLinear(team.num_robots, team.obs_width, width, generator)
        self.second = PerRobotLinear(team.num_robots, width, width, generator)
        self.output = PerRobotLinear(team.num_robots, width, 1, generator)

    def forward(self, obs: Tensor, actions: Tensor, available: Tensor | None) -> CriticOutput:
        """Map observations (R, B, D) to values (R, 1, B), whatever the team does."""
        del actions, available
        hidden = functional.leaky_relu(self.first(obs))
        hidden = functional.leaky_relu(self.second(hidden))
        return CriticOutput(self.output.batch_last(hidden), attended=None)


def draw_networks(
    team: Team, network: NetworkConfig, generator: torch.Generator
) -> tuple[Actor, OwnCritic]:
    """The policies and critics, with initial parameters."""
    sizes = (team.num_robots, team.obs_width, team.num_actions, network.hidden_width)
    return Actor(*sizes, generator), OwnCritic(team, network.hidden_width, generator)


class IPPO(ActorCritic):
    """The learner. `ActorCritic` acts, imitates, saves, loads and compiles."""

    _metric_names = METRICS

    def __init__(
        self,
        team: Team,
        network: NetworkConfig,
        config: IPPOConfig,
        *,
        seed: int,
        device: torch.device,
    ) -> None:
        super().__init__(
            team,
            network,
            learning_rate=config.learning_rate,
            final_learning_rate_share=0.1,
            critic_weight_decay=0.0,
            seed=seed,
            device=device,
            draw=draw_networks,
        )
        self._config = config
        self._shuffle = torch.Generator().manual_seed(seed)
        self._scale = ReturnScale(team.num_robots, config.gamma, device)
        self._buffer = RolloutBuffer(config.rollout_steps, team, device, torch.float32)
        self._frozen = False

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Store one control step of all worlds."""
        if self.actor_frozen != self._frozen:  # a rollout belongs to one policy
            self._buffer.clear()
            self._scale.forget_open_returns()
            self._frozen = self.actor_frozen
        self._buffer.add(batch, truncated, None)

    def learn(self) -> dict[str, float] | None:
        """Train on the rollout when it is full; returns the means of the metrics."""
        config = self._config
        if not self._buffer.full:
            return None
        rollout = self._rollout()
        self._buffer.clear()
        for _ in range(config.epochs):
            order = torch.randperm(rollout.obs.shape[1], generator=self._shuffle)
            # Parts of nearly one size: the rows of a short last one would weigh more.
            for chosen in order.tensor_split(-(-len(order) // config.minibatch_size)):
                rows = rollout.take(chosen.to(self._device))
                self._do_update(len(chosen), partial(self.update, rows))
        return self._take_metrics()

    @torch.no_grad()
    def update(self, rows: Rollout) -> Tensor:
        """Train critic and actor on some rows; returns the metrics."""
        return self._update(rows.obs, rows.actions, rows.log_prob, rows.advantage, rows.target)

    @torch.no_grad()
    def _rollout(self) -> Rollout:
        """Advantages and lambda-returns of each robot from its own rewards and values."""
        config = self._config
        steps = self._buffer.steps()
        self._scale.update(steps.reward, steps.ended)
        reward = (steps.reward / self._scale.std(0.01).unsqueeze(1)).to(self._dtype)
        rows = self.critic(steps.obs, steps.actions, None).q.squeeze(1)
        value = steps_of(rows, len(reward))
        next_value = torch.cat([value[1:], torch.zeros_like(value[:1])])
        step, env = steps.cut.nonzero(as_tuple=True)  # no next step in the rollout
        next_value[step, :, env] = self.critic(steps.after, steps.actions, None).q.squeeze(1).t()
        advantage = generalised_advantage(
            reward,
            value,
            next_value,
            steps.terminated,
            steps.ended,
            config.gamma,
            config.gae_lambda,
        )
        log_prob = self.actor(steps.obs).log_softmax(dim=1)
        return Rollout(
            obs=steps.obs,
            actions=steps.actions,
            log_prob=losses.gather_actions(log_prob, steps.actions),
            # Rewards that never differ say nothing: advantages are then errors of the critic.
            advantage=standardised(rows_of(advantage)) * self._scale.has_spread().unsqueeze(1),
            target=rows_of(advantage + value),
        )

    def _running(self) -> dict[str, Tensor]:
        """What is saved beside networks and optimisers."""
        return {f"scale.{name}": tensor for name, tensor in self._scale.tensors().items()}

    def _update_networks(
        self,
        nets: Networks,
        obs: Tensor,
        actions: Tensor,
        before: Tensor,
        advantage: Tensor,
        target: Tensor,
        rate: Tensor,
    ) -> Tensor:
        """One update. It calls networks only through ``nets``, so that it can be compiled."""
        config = self._config

        def critic_loss(critic: Forward) -> tuple[Tensor, tuple[Tensor, ...]]:
            found = critic(obs, actions, None).q.squeeze(1)
            loss = losses.critic_loss(found, target)
            return loss, (loss.detach(), found.detach().mean())

        def actor_loss(actor: Forward) -> tuple[Tensor, tuple[Tensor, ...]]:
            log_prob = actor(obs).log_softmax(dim=1)
            entropy = losses.entropy(log_prob).mean(dim=1)
            now = losses.gather_actions(log_prob, actions)
            loss = losses.clipped_policy_loss(now, before, advantage, config.clip)
            loss = loss - config.entropy_weight * entropy.sum()
            clipped = ((now.detach() - before).exp() - 1.0).abs() > config.clip
            return loss, (loss.detach(), entropy.detach().mean(), clipped.to(obs.dtype).mean())

        gradients, critic_metrics = nets.critic.gradients(critic_loss)
        clip_norm_by_robot(gradients, 40.0)
        nets.critic.step(gradients, rate)
        gradients, actor_metrics = nets.actor.gradients(actor_loss)
        clip_norm_by_robot(gradients, 0.5)
        if not self.actor_frozen:
            nets.actor.step(gradients, rate)
        return torch.stack([*critic_metrics, *actor_metrics])
