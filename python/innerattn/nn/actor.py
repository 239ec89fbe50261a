"""The actors: each robot's policy, from its own observation to its own actions.

It computes logits and draws actions from them; losses are in `innerattn.learn`. What the outputs of
another kind of actions mean is in `innerattn.nn.actions`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.encoder import EntityColumns, EntityEncoder, observation_encoder
from innerattn.nn.linear import PerRobotLinear


class Actor(nn.Module):
    """The policies of all robots, with two hidden layers; every robot has its own parameters."""

    def __init__(
        self,
        num_robots: int,
        obs_width: int,
        num_actions: int,
        hidden_width: int,
        generator: torch.Generator,
        entities: EntityColumns | None = None,
        extra_width: int = 0,
        pooling: str = "attention",
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            obs_width: D.
            num_actions: A, or the outputs for another kind of actions.
            hidden_width: Width of both hidden layers.
            generator: Source of the initial parameters, on the CPU.
            entities: Columns of the entities to encode separately; None: encode the whole row.
            extra_width: Further columns behind the observation, which belong to the robot itself.
            pooling: How `EntityEncoder` sums up entities.
        """
        super().__init__()
        self.num_robots = num_robots
        self.first = observation_encoder(
            num_robots, obs_width, hidden_width, generator, entities, extra_width, pooling
        )
        self.second = PerRobotLinear(num_robots, hidden_width, hidden_width, generator)
        self.output = PerRobotLinear(num_robots, hidden_width, num_actions, generator)

    def forward(self, obs: Tensor) -> Tensor:
        """Map observations (R, B, D) to action logits (R, A, B)."""
        hidden = functional.leaky_relu(self.first(obs))
        hidden = functional.leaky_relu_(self.second(hidden))
        return self.output.batch_last(hidden)

    def teammate_weights(self, obs: Tensor) -> Tensor | None:
        """See `EntityEncoder.teammate_weights`; None where whole rows are encoded."""
        return self.first.teammate_weights(obs) if isinstance(self.first, EntityEncoder) else None


class MaskedActor(Actor):
    """Policies that stay for certain, with action 0, where a robot cannot act.

    Attributes:
        able: Columns of an observation that are all above 0 where the robot can act.
    """

    able: tuple[int, ...]

    def forward(self, obs: Tensor) -> Tensor:
        """Map observations (R, B, D) to action logits (R, A, B)."""
        logits = super().forward(obs)
        unable = (obs[:, :, list(self.able)] <= 0.0).any(2)
        moves = torch.arange(logits.shape[1], device=obs.device) > 0
        hidden = unable.unsqueeze(1) & moves.view(1, -1, 1)
        return logits.masked_fill(hidden, torch.finfo(logits.dtype).min)


def action_noise(
    shape: tuple[int, ...], generator: torch.Generator, dtype: torch.dtype = torch.float32
) -> Tensor:
    """Noise for `sample_actions`: log(-log(u)) of uniform u, which is minus a Gumbel variable.

    Args:
        shape: (R, A, B).
        generator: Source of the draw; the noise is made on its device.
        dtype: Type of the logits.
    """
    noise = torch.empty(shape, dtype=dtype, device=generator.device).uniform_(generator=generator)
    # -log(u) is exponential and never 0, since u is never 1. An infinite Gumbel variable would
    # choose even an impossible action. (`exponential_` can return 0, and is slower.)
    return noise.clamp_min_(torch.finfo(dtype).tiny).log_().neg_().log_()


def sample_actions(logits: Tensor, noise: Tensor) -> Tensor:
    """Draw an action of every robot from softmax(logits), by the Gumbel-max trick.

    Args:
        logits: (R, A, B), normalised or not.
        noise: (R, A, B) of `action_noise`.

    Returns:
        (R, B) int64.
    """
    return (logits.detach() - noise).max(dim=1).indices  # argmax is many times slower here
