"""What every learner here is made of: per-robot actors, a critic, and their Adams.

It acts, reports attention, saves and loads; when and how to update is each learner's own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from innerattn.config import NetworkConfig
from innerattn.learn import losses
from innerattn.learn.adam import AdamStepper, Forward, Stepper
from innerattn.learn.compiled import traced
from innerattn.learn.networks import draw_networks
from innerattn.learn.types import Team
from innerattn.nn import CriticOutput, action_noise, sample_actions


@dataclass(frozen=True)
class Networks:
    """The networks of an update, plain or traced."""

    actor: Stepper
    critic: Stepper


class ActorCritic:
    """Networks and optimisers of a learner.

    A subclass decides when to update and gives `_update_networks`.

    Attributes:
        actor: The trained policies.
        critic: The trained critics.
        actor_frozen: While set, updates leave the policies as they are; see `Learner`.
    """

    _update_networks: Callable[..., Tensor]
    """All arithmetic of one update, from `Networks`, batches and the step size () to figures (n,).

    It must call networks through `Networks` only, and hold nothing that a compiler cannot follow.
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
        critic_outputs: int | None = None,
    ) -> None:
        """Build networks and optimisers.

        Args:
            team: What is known of the team.
            network: Sizes and kind of the networks.
            learning_rate: Step size of both Adams at the start.
            final_learning_rate_share: Share of it that is left at the end of training.
            critic_weight_decay: Weight of the L2 penalty of the critic's Adam.
            seed: Seed of the initial weights and of every draw.
            device: Where the networks live.
            dtype: Floating-point type of the networks.
            critic_outputs: Values that the critic gives for each robot; None: one for each action.

        Raises:
            ValueError: `network.mask_unavailable` is set without a column of the observation, or as
                in `draw_networks`.
        """
        column = team.availability_column
        if network.mask_unavailable and column not in range(team.obs_width):
            raise ValueError(
                f"availability_column = {column}: network.mask_unavailable needs a "
                f"column in 0..{team.obs_width - 1}"
            )
        self._availability_column = column if network.mask_unavailable else None
        self._device, self._dtype = device, dtype
        self._bfloat16 = network.precision == "bfloat16"
        self._first_rate, self._final_share = learning_rate, final_learning_rate_share
        self._rate = learning_rate
        weights_seed, noise_seed, self._data_seed = (
            int(child.generate_state(1, np.uint64)[0])
            for child in np.random.SeedSequence(seed).spawn(3)
        )
        self._noise = torch.Generator(device).manual_seed(noise_seed)
        # Drawn on the CPU in float32 and then moved: a seed gives the same weights everywhere.
        weights = torch.Generator().manual_seed(weights_seed)
        actor, critic = draw_networks(team, network, weights, critic_outputs)
        self.actor, self.critic = actor.to(device, dtype), critic.to(device, dtype)
        self.actor_frozen = False
        self._actor_adam = AdamStepper(self.actor)
        self._critic_adam = AdamStepper(self.critic, critic_weight_decay)
        self._networks = Networks(self._actor_adam, self._critic_adam)
        self._team = team
        self._updates = 0

    @property
    def updates(self) -> int:
        """Number of updates done so far."""
        return self._updates

    def compile(self, backend: str = "inductor") -> None:
        """Do updates as one compiled graph from now on; see `Learner.compile`."""
        plain = self._networks
        forms: Any = {field.name: traced(getattr(plain, field.name)) for field in fields(plain)}
        self._networks = type(plain)(**forms)
        self._update_networks = torch.compile(
            self._update_networks, fullgraph=True, dynamic=False, backend=backend
        )

    @torch.no_grad()
    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Choose actions (E, R) int64 for observations (E, R, D); see `Learner.act`."""
        logits = self.actor(self._robots_first(obs))
        if greedy:
            actions: Tensor = logits.argmax(dim=1)
        else:
            actions = sample_actions(logits, self._draw(logits.shape))
        return actions.t().contiguous().to(obs.device)

    @torch.no_grad()
    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        """Step the policies towards given actions; see `Learner.imitate`."""
        seen, wanted = self._robots_first(obs), actions.to(self._device).t()

        def loss_of(actor: Forward) -> tuple[Tensor, Tensor]:
            log_prob = actor(seen).log_softmax(dim=1)
            loss = -losses.gather_actions(log_prob, wanted).mean(dim=1)
            return loss.sum(), loss.detach().mean()

        gradients, loss = self._actor_adam.gradients(loss_of)
        self._actor_adam.step(gradients, _step_size(learning_rate))
        return float(loss)

    def set_progress(self, share: float) -> None:
        """Let the step size fall evenly; see `Learner.set_progress`."""
        self._rate = (1.0 - (1.0 - self._final_share) * share) * self._first_rate

    def attention(self, obs: Tensor, actions: Tensor) -> Tensor | None:
        """Attention weights (B, H, R, R) of the critic, if it has any; see `Learner.attention`."""
        obs = self._robots_first(obs)
        with torch.no_grad():
            output: CriticOutput = self.critic(
                obs, actions.to(self._device).t(), self._available(obs)
            )
        return None if output.attended is None else output.attended.weights

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

    def _modules(self) -> dict[str, nn.Module]:
        """All networks that are part of the state, by name."""
        return {"actor": self.actor, "critic": self.critic}

    def _running(self) -> dict[str, Tensor]:
        """Live tensors of running numbers that are part of the state, by name."""
        return {}

    def _tensors(self) -> dict[str, Tensor]:
        """Live tensors of the state by name."""
        tensors = self._running()
        for name, module in self._modules().items():
            tensors |= {f"{name}.{key}": value for key, value in module.named_parameters()}
        for name, adam in (("actor_adam", self._actor_adam), ("critic_adam", self._critic_adam)):
            for key, moments in adam.moments.items():
                tensors |= {f"{name}.{key}.{part}": moments[part] for part in sorted(moments)}
        return tensors

    def _update(self, *tensors: Tensor) -> Tensor:
        """Do `_update_networks` with products of the precision that was asked for; count it."""
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._bfloat16):
            figures = self._update_networks(self._networks, *tensors, _step_size(self._rate))
        self._updates += 1
        return figures

    def _draw(self, shape: tuple[int, ...]) -> Tensor:
        """Noise for `sample_actions`, of the shape of the logits."""
        return action_noise(shape, self._noise, self._dtype)

    def _robots_first(self, obs: Tensor) -> Tensor:
        """Bring (B, R, D) to (R, B, D), as the networks take it, on their device and dtype."""
        return obs.to(self._device, self._dtype).transpose(0, 1)

    def _available(self, obs: Tensor) -> Tensor | None:
        """(B, R) bool from observations (R, B, D); None where no robot is to be masked."""
        if self._availability_column is None:
            return None
        return (obs[:, :, self._availability_column] > 0.5).t()


def _step_size(rate: float) -> Tensor:
    """() float64 on the CPU: a graph would be compiled anew for every other plain number."""
    return torch.tensor(rate, dtype=torch.float64)
