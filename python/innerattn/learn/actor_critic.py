"""What every learner here is made of: per-robot actors, a critic with attention, and their Adams.

It acts, reports attention, saves and loads; when and how to update is each learner's own.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from innerattn.config.run import NetworkConfig
from innerattn.learn.types import Team
from innerattn.nn import Actor, Critic, InnerAttention, UniformAttention, sample_actions

_ATTENTIONS: dict[str, type[InnerAttention] | type[UniformAttention]] = {
    "inner": InnerAttention,
    "uniform": UniformAttention,
}


class ActorCritic:
    """Networks and optimisers of a learner.

    Attributes:
        actor: The trained policies.
        critic: The trained critics.
        actor_adam: Optimiser of the policies.
        critic_adam: Optimiser of the critics.
    """

    def __init__(
        self,
        team: Team,
        network: NetworkConfig,
        *,
        learning_rate: float,
        final_learning_rate_share: float,
        critic_weight_decay: float,
        seed: int,
        device: torch.device,
        dtype: torch.dtype = torch.float32,
        availability_column: int | None = None,
        critic_outputs: int | None = None,
    ) -> None:
        """Build networks and optimisers.

        Args:
            team: Sizes of the team.
            network: Sizes and kind of the networks.
            learning_rate: Step size of both Adams at the start.
            final_learning_rate_share: Share of it that is left at the end of training.
            critic_weight_decay: L2 penalty of the critic's Adam.
            seed: Seed of the initial weights and of every draw.
            device: Where the networks live.
            dtype: Floating-point type of the networks.
            availability_column: Column of a robot's observation that says whether it is available
                (above 0.5); needed only where `network.mask_unavailable` is set.
            critic_outputs: Values that the critic gives for each robot; None: one for each action.

        Raises:
            ValueError: `network.mask_unavailable` is set without a column of the observation.
        """
        if network.mask_unavailable and availability_column not in range(team.obs_width):
            raise ValueError(
                f"availability_column = {availability_column}: network.mask_unavailable needs a "
                f"column in 0..{team.obs_width - 1}"
            )
        self._availability_column = availability_column if network.mask_unavailable else None
        self._device, self._dtype = device, dtype
        self._learning_rate, self._final_share = learning_rate, final_learning_rate_share
        weights_seed, noise_seed, self._data_seed = (
            int(child.generate_state(1, np.uint64)[0])
            for child in np.random.SeedSequence(seed).spawn(3)
        )
        self._noise = torch.Generator(device).manual_seed(noise_seed)
        # Drawn on the CPU in float32 and then moved: a seed gives the same weights everywhere.
        weights = torch.Generator().manual_seed(weights_seed)
        width = network.hidden_width
        attention = _ATTENTIONS[network.attention](width, network.attention_heads, weights)
        self.actor = Actor(*team, width, weights).to(device, dtype)
        self.critic = Critic(*team, attention, weights, critic_outputs).to(device, dtype)
        self.actor_adam = _adam(self.actor, learning_rate, weight_decay=0.0)
        self.critic_adam = _adam(self.critic, learning_rate, critic_weight_decay)
        self._updates = 0

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

    def reach(self, share: float) -> None:
        """Let the step size fall evenly from its first to its final value; see `Learner.reach`."""
        left = 1.0 - (1.0 - self._final_share) * share
        for adam in (self.actor_adam, self.critic_adam):
            for group in adam.param_groups:
                group["lr"] = left * self._learning_rate

    def attention(self, obs: Tensor, actions: Tensor) -> Tensor:
        """Attention weights (B, H, R, R) of the critic; see `Learner.attention`."""
        obs = self._robots_first(obs)
        with torch.no_grad():
            output = self.critic(obs, actions.to(self._device).t(), self._available(obs))
        weights: Tensor = output.attended.weights
        return weights

    def state(self) -> dict[str, Tensor]:
        """Copies of all weights, optimiser moments and running numbers, and the count of updates.

        What is collected and the random generators are not part of it.
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

    def _networks(self) -> dict[str, nn.Module]:
        """All networks that are part of the state, by name."""
        return {"actor": self.actor, "critic": self.critic}

    def _running(self) -> dict[str, Tensor]:
        """Live tensors of running numbers that are part of the state, by name."""
        return {}

    def _tensors(self) -> dict[str, Tensor]:
        """Live tensors of the state by name."""
        tensors = self._running()
        for name, network in self._networks().items():
            tensors |= {f"{name}.{key}": value for key, value in network.named_parameters()}
        for name, network, adam in (
            ("actor_adam", self.actor, self.actor_adam),
            ("critic_adam", self.critic, self.critic_adam),
        ):
            for key, parameter in network.named_parameters():
                moments = adam.state[parameter]
                tensors |= {f"{name}.{key}.{part}": moments[part] for part in sorted(moments)}
        return tensors

    def _step_critic(self, loss: Tensor, grad_clip: float) -> Tensor:
        """A step of the critic's Adam down a loss summed over robots; the norm before clipping."""
        self.critic_adam.zero_grad()
        torch.autograd.backward(loss)
        # The loss is a sum over robots, so what they share would learn faster with every robot
        # more; MAAC likewise divides its gradient by their number, before clipping.
        for shared in self.critic.attention.parameters():
            if shared.grad is not None:
                shared.grad.div_(self.actor.num_robots)
        norm = nn.utils.clip_grad_norm_(self.critic.parameters(), grad_clip)
        self.critic_adam.step()
        return norm

    def _step_actor(self, loss: Tensor, grad_clip: float) -> Tensor:
        """A step of the actors' Adam, each robot clipped alone; the norms (R,) before clipping."""
        self.actor_adam.zero_grad()
        torch.autograd.backward(loss)
        norms = _clip_each_robot(self.actor, grad_clip)
        self.actor_adam.step()
        return norms

    def _robots_first(self, obs: Tensor) -> Tensor:
        """Bring (B, R, D) to (R, B, D), as the networks take it, on their device and dtype."""
        return obs.to(self._device, self._dtype).transpose(0, 1)

    def _available(self, obs: Tensor) -> Tensor | None:
        """(B, R) bool from observations (R, B, D); None where no robot is to be masked."""
        if self._availability_column is None:
            return None
        return (obs[:, :, self._availability_column] > 0.5).t()


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
