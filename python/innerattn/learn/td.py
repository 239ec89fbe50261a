"""The off-policy learner: a maximum-entropy actor-critic with attention in the critic.

It decides when to update and how; networks live in `nn`, formulas in `losses`. Sources: eqs. 2-4 of
the paper and Iqbal & Sha 2019, sections 3.1-3.3 ("MAAC").
"""

from __future__ import annotations

import copy

import numpy as np
import torch
from torch import Tensor, nn

from innerattn.config.run import NetworkConfig, TDConfig
from innerattn.learn import losses
from innerattn.learn.replay import Replay
from innerattn.learn.types import Team, Transitions
from innerattn.nn import Actor, Critic, InnerAttention, UniformAttention, sample_actions

_ATTENTIONS: dict[str, type[InnerAttention] | type[UniformAttention]] = {
    "inner": InnerAttention,
    "uniform": UniformAttention,
}
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


class TD:
    """The off-policy learner; its contract is `innerattn.learn.types.Learner`.

    Attributes:
        actor: The trained policies.
        critic: The trained critics.
        target_actor: Slow copy of the policies.
        target_critic: Slow copy of the critics.
        replay: Past transitions.
    """

    def __init__(
        self,
        team: Team,
        network: NetworkConfig,
        td: TDConfig,
        *,
        seed: int,
        device: torch.device,
        dtype: torch.dtype = torch.float32,
        availability_column: int | None = None,
    ) -> None:
        """Build networks, optimisers and replay.

        Args:
            team: Sizes of the team.
            network: Sizes and kind of the networks.
            td: Numbers of the algorithm.
            seed: Seed of the initial weights and of every draw.
            device: Where networks and replay live.
            dtype: Floating-point type of the networks.
            availability_column: Column of a robot's observation that says whether it is available
                (above 0.5); needed only where `network.mask_unavailable` is set.

        Raises:
            ValueError: `network.mask_unavailable` is set without a column of the observation.
        """
        if network.mask_unavailable and availability_column not in range(team.obs_width):
            raise ValueError(
                f"availability_column = {availability_column}: network.mask_unavailable needs a "
                f"column in 0..{team.obs_width - 1}"
            )
        self._availability_column = availability_column if network.mask_unavailable else None
        self._config = td
        self._temperature = 1.0 / td.reward_scale
        self._target = _TARGETS[td.entropy_target]
        self._policy_loss = _POLICY_LOSSES[td.policy_gradient]
        self._device, self._dtype = device, dtype
        weights_seed, noise_seed, replay_seed = (
            int(child.generate_state(1, np.uint64)[0])
            for child in np.random.SeedSequence(seed).spawn(3)
        )
        self._noise = torch.Generator(device).manual_seed(noise_seed)
        self.replay = Replay(td.replay_capacity, team, replay_seed, device)
        # Drawn on the CPU in float32 and then moved: a seed gives the same weights everywhere.
        weights = torch.Generator().manual_seed(weights_seed)
        width = network.hidden_width
        attention = _ATTENTIONS[network.attention](width, network.attention_heads, weights)
        self.actor = Actor(*team, width, weights).to(device, dtype)
        self.critic = Critic(*team, attention, weights).to(device, dtype)
        self.target_actor = copy.deepcopy(self.actor).requires_grad_(False)
        self.target_critic = copy.deepcopy(self.critic).requires_grad_(False)
        self._actor_adam = _adam(self.actor, td.learning_rate, weight_decay=0.0)
        self._critic_adam = _adam(self.critic, td.learning_rate, td.critic_weight_decay)
        self._updates = 0
        self._unpaid_env_steps = 0

    @property
    def updates(self) -> int:
        """Number of updates done so far."""
        return self._updates

    @torch.no_grad()
    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Choose actions (E, R) int64 for observations (E, R, D); see `Learner.act`."""
        logits = self.actor(self._robots_first(obs))
        actions = logits.argmax(dim=1) if greedy else sample_actions(logits, self._noise)
        return actions.t().contiguous().to(obs.device)

    def observe(self, batch: Transitions, truncated: Tensor) -> None:
        """Store one control step of E worlds; see `Learner.observe`."""
        del truncated  # a time limit is no termination: the target looks past it
        self.replay.add(batch)
        if len(self.replay) >= min(self._config.warmup_env_steps, self.replay.capacity):
            self._unpaid_env_steps += len(batch.obs)

    def reach(self, share: float) -> None:
        """Let the step size fall evenly from its first to its final value; see `Learner.reach`."""
        config = self._config
        left = 1.0 - (1.0 - config.final_learning_rate_share) * share
        for adam in (self._actor_adam, self._critic_adam):
            for group in adam.param_groups:
                group["lr"] = left * config.learning_rate

    def learn(self) -> dict[str, float] | None:
        """Do one update for every `update_every_env_steps` env-steps since the warm-up.

        Returns:
            Means over the updates done now; None when none was due. `critic_loss` and `actor_loss`
            are summed over robots, `q_mean` is of the actions taken, `policy_entropy` is in nats;
            `critic_grad_norm` and `actor_grad_norm` (its mean over robots) are before clipping.
        """
        every = self._config.update_every_env_steps
        due, self._unpaid_env_steps = divmod(self._unpaid_env_steps, every)
        if not due:
            return None
        rows = [self.update(self.replay.sample(self._config.batch_size)) for _ in range(due)]
        means = torch.stack(rows).mean(dim=0).tolist()
        return dict(zip(_METRICS, means, strict=True))

    def update(self, batch: Transitions) -> Tensor:
        """Update the critic, then the actors by the new critic, then the target networks.

        Args:
            batch: At least one transition; rewards are normalised by the replay's statistics.

        Returns:
            (6,) the values that `learn` names, in that order.
        """
        obs = self._robots_first(batch.obs)
        critic_values = self._update_critic(obs, batch)
        actor_values = self._update_actor(obs)
        for network, target in (
            (self.critic, self.target_critic),
            (self.actor, self.target_actor),
        ):
            torch._foreach_lerp_(
                list(target.parameters()), list(network.parameters()), self._config.polyak
            )
        self._updates += 1
        return torch.stack(critic_values + actor_values)

    def attention(self, obs: Tensor, actions: Tensor) -> Tensor:
        """Attention weights (B, H, R, R) of the critic; see `Learner.attention`."""
        obs = self._robots_first(obs)
        with torch.no_grad():
            output = self.critic(obs, actions.to(self._device).t(), self._available(obs))
        weights: Tensor = output.attended.weights
        return weights

    def state(self) -> dict[str, Tensor]:
        """Copies of all weights, target weights, optimiser moments and the count of updates.

        The replay and the random generators are not part of it.
        """
        state = {name: tensor.detach().clone() for name, tensor in self._tensors().items()}
        return state | {"updates": torch.tensor(self._updates)}

    def load(self, state: dict[str, Tensor]) -> None:
        """Take over what `state` returned, on whatever device it lies.

        Raises:
            ValueError: A name, shape or dtype is wrong; the learner is left unchanged.
        """
        own = self._tensors() | {"updates": torch.tensor(self._updates)}
        for name in sorted(own.keys() | state.keys()):
            if name not in state:
                raise ValueError(f"state has no tensor {name!r}")
            if name not in own:
                raise ValueError(f"state has an unknown tensor {name!r}")
            given, wanted = state[name], own[name]
            if given.shape != wanted.shape or given.dtype != wanted.dtype:
                raise ValueError(
                    f"state[{name!r}] is {given.dtype} {tuple(given.shape)}: must be "
                    f"{wanted.dtype} {tuple(wanted.shape)}"
                )
        with torch.no_grad():
            for name, tensor in own.items():
                tensor.copy_(state[name])
        self._updates = int(own["updates"])

    def _update_critic(self, obs: Tensor, batch: Transitions) -> list[Tensor]:
        config = self._config
        target = self._targets(batch)
        actions = batch.actions.to(self._device).t()
        output = self.critic(obs, actions, self._available(obs))
        q_taken = losses.taken(output.q, actions)
        loss = losses.critic_loss(q_taken, target)
        scores, visible = output.attended.scores, output.attended.visible
        if config.attention_logit_penalty and scores is not None:
            penalty = losses.attention_logit_penalty(scores, visible)
            loss = loss + config.attention_logit_penalty * penalty
        self._critic_adam.zero_grad()
        torch.autograd.backward(loss)
        # The loss is a sum over robots, so what they share would learn faster with every robot
        # more; MAAC likewise divides its gradient by their number, before clipping.
        for shared in self.critic.attention.parameters():
            if shared.grad is not None:
                shared.grad.div_(len(obs))
        norm = nn.utils.clip_grad_norm_(self.critic.parameters(), config.critic_grad_clip)
        self._critic_adam.step()
        return [loss.detach(), q_taken.detach().mean(), norm]

    def _update_actor(self, obs: Tensor) -> list[Tensor]:
        log_prob = self.actor(obs).log_softmax(dim=1)
        with torch.no_grad():
            actions = sample_actions(log_prob, self._noise)
            q = self.critic(obs, actions, self._available(obs)).q
            entropy = -(log_prob.exp() * log_prob).sum(dim=1).mean()
        loss = self._policy_loss(log_prob, q, actions, self._temperature)
        self._actor_adam.zero_grad()
        torch.autograd.backward(loss)
        norms = _clip_each_robot(self.actor, self._config.actor_grad_clip)
        self._actor_adam.step()
        return [loss.detach(), entropy, norms.mean()]

    @torch.no_grad()
    def _targets(self, batch: Transitions) -> Tensor:
        """The targets (R, B) of a batch; the next actions are drawn from the target policy."""
        next_obs = self._robots_first(batch.next_obs)
        log_prob = self.target_actor(next_obs).log_softmax(dim=1)
        actions = sample_actions(log_prob, self._noise)
        q = self.target_critic(next_obs, actions, self._available(next_obs)).q
        deviation = self.replay.reward_std.clamp_min(self._config.reward_std_floor)
        reward = (batch.reward.to(self._device) - self.replay.reward_mean) / deviation
        continues = ~batch.terminated.to(self._device)
        return self._target(
            reward.t().to(self._dtype),
            losses.taken(q, actions),
            self._temperature * losses.taken(log_prob, actions),
            self._config.gamma * continues.to(self._dtype),
        )

    def _robots_first(self, obs: Tensor) -> Tensor:
        """Bring (B, R, D) to (R, B, D), as the networks take it, on their device and dtype."""
        return obs.to(self._device, self._dtype).transpose(0, 1)

    def _available(self, obs: Tensor) -> Tensor | None:
        """(B, R) bool from observations (R, B, D); None where no robot is to be masked."""
        if self._availability_column is None:
            return None
        return (obs[:, :, self._availability_column] > 0.5).t()

    def _tensors(self) -> dict[str, Tensor]:
        """Live tensors of the state by name."""
        tensors: dict[str, Tensor] = {}
        for name in ("actor", "critic", "target_actor", "target_critic"):
            network: nn.Module = getattr(self, name)
            tensors |= {f"{name}.{key}": value for key, value in network.named_parameters()}
        for name, network, adam in (
            ("actor_adam", self.actor, self._actor_adam),
            ("critic_adam", self.critic, self._critic_adam),
        ):
            for key, parameter in network.named_parameters():
                moments = adam.state[parameter]
                tensors |= {f"{name}.{key}.{part}": moments[part] for part in sorted(moments)}
        return tensors


def _adam(network: nn.Module, learning_rate: float, weight_decay: float) -> torch.optim.Adam:
    """Adam with its moments in place from the start, so that a state always has the same names."""
    parameters = list(network.parameters())
    adam = torch.optim.Adam(parameters, learning_rate, weight_decay=weight_decay, fused=True)
    for parameter in parameters:
        adam.state[parameter] = {
            "step": torch.zeros((), dtype=torch.float32, device=parameter.device),
            "exp_avg": torch.zeros_like(parameter),
            "exp_avg_sq": torch.zeros_like(parameter),
        }
    return adam


def _clip_each_robot(network: nn.Module, limit: float) -> Tensor:
    """Scale the gradient of each robot with a norm above the limit down to it.

    Every parameter has robots first, (R, ...). Returns the norms (R,) before clipping.
    """
    gradients = [parameter.grad for parameter in network.parameters()]
    flat = [gradient.flatten(1) for gradient in gradients if gradient is not None]
    norms: Tensor = torch.linalg.vector_norm(
        torch.stack([torch.linalg.vector_norm(g, dim=1) for g in flat]), dim=0
    )
    factors = (limit / (norms + 1e-6)).clamp_max(1.0).unsqueeze(1)
    torch._foreach_mul_(flat, [factors] * len(flat))
    return norms
