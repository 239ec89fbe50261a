"""The centralised critic: Q of every own action of every robot, with attention over teammates.

It computes values; targets and losses are in `innerattn.learn`. Structure: eqs. 2-4 of the paper
and Iqbal & Sha 2019, section 3.2.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.attention import Attended, TeammateAttention
from innerattn.nn.encoder import EntityColumns, EntityEncoder, observation_encoder
from innerattn.nn.linear import PerRobotLinear
from innerattn.nn.partner import OracleAttention, right_partners


class CriticOutput(NamedTuple):
    """Values of a batch.

    Attributes:
        q: (R, A, B) ``Q_i(o, a, a_-i)`` for every own action a, or (R, outputs, B) other values.
            The own action of robot i is not an input of its values.
        attended: Result of the attention; None if the critic has no attention.
    """

    q: Tensor
    attended: Attended | None


class Critic(nn.Module):
    """The critics of all robots. Every robot has its own encoders and head; attention is shared."""

    def __init__(
        self,
        num_robots: int,
        obs_width: int,
        num_actions: int,
        attention: TeammateAttention,
        generator: torch.Generator,
        outputs: int | None = None,
        entities: EntityColumns | None = None,
        extra_width: int = 0,
        pooling: str = "attention",
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            obs_width: D.
            num_actions: A.
            attention: The attention over teammates; its width is the width of every layer.
            generator: Source of the initial parameters, on the CPU.
            outputs: Values for each robot; None: one for each own action.
            entities: Columns of the entities to encode separately; None: encode the whole row.
            extra_width: Further columns behind the observation, which belong to the robot itself.
            pooling: How `EntityEncoder` sums up entities.
        """
        super().__init__()
        width = attention.width
        self.num_actions = num_actions
        self.state_encoder = observation_encoder(
            num_robots, obs_width, width, generator, entities, extra_width, pooling
        )
        inputs = extra_width + num_actions
        self.action_encoder = observation_encoder(
            num_robots, obs_width, width, generator, entities, inputs, pooling
        )
        self.attention = attention
        self.hidden = PerRobotLinear(num_robots, 2 * width, width, generator)
        self.output = PerRobotLinear(num_robots, width, outputs or num_actions, generator)

    def forward(
        self, obs: Tensor, actions: Tensor, available: Tensor | None = None
    ) -> CriticOutput:
        """Value every own action.

        Args:
            obs: (R, B, D) observations.
            actions: (R, B) int64 actions; robot i's own is an input of its teammates' values only.
            available: (B, R) bool; the attention masks unavailable robots. None: all are
                available.
        """
        if isinstance(self.attention, OracleAttention):
            available = right_partners(obs, self.attention.partners, available)
        return self.value(*self.encode(obs, actions), available)

    def encode(self, obs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor]:
        """The encodings e_i^s of observations alone and e_i of observations and actions.

        Args:
            obs: (R, B, D) observations.
            actions: (R, B) int64 actions.

        Returns:
            Both (R, B, W).
        """
        chosen = self.action_inputs(obs, actions)
        state, action = self.state_encoder, self.action_encoder
        if isinstance(state, EntityEncoder) and isinstance(action, EntityEncoder):
            seen = state.read(obs)
            own, others = state.encode(seen), action.encode(seen, chosen)
        else:
            own, others = state(obs), action(torch.cat([obs, chosen], dim=2))
        return functional.leaky_relu(own), functional.leaky_relu(others)

    def action_inputs(self, obs: Tensor, actions: Tensor) -> Tensor:
        """Actions as numbers (R, B, A): one column for each action, 1 for the one taken."""
        chosen = obs.new_zeros(*actions.shape, self.num_actions)
        return chosen.scatter_(2, actions.unsqueeze(2), 1.0)

    def value(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> CriticOutput:
        """Value every own action from the encodings that `encode` gives, (R, B, W) each."""
        attended = self.attention(own, others, available)
        hidden = functional.leaky_relu_(self.hidden.side_by_side(own, attended.mixed))
        return CriticOutput(self.output.batch_last(hidden), attended)


class VectorCritic(Critic):
    """The same critics where an action is a vector, whose A numbers are inputs as they are.

    It values states, not every own action, so the number of outputs must be given. Actions are
    (R, B, A) numbers wherever `Critic` takes (R, B) int64.
    """

    def action_inputs(self, obs: Tensor, actions: Tensor) -> Tensor:
        """The actions, of the dtype of the observations."""
        return actions.to(obs.dtype)
