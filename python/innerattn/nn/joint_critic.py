"""The centralised critics without attention: each robot's values from all observations.

They compute values; targets and losses are in `innerattn.learn`. Source: Yu et al. 2022 ("MAPPO").
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.critic import CriticOutput
from innerattn.nn.linear import PerRobotLinear


class JointCritic(nn.Module):
    """The critics of all robots, with two hidden layers; robots share no parameters."""

    def __init__(
        self,
        num_robots: int,
        obs_width: int,
        outputs: int,
        hidden_width: int,
        generator: torch.Generator,
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            obs_width: D.
            outputs: Values for each robot.
            hidden_width: Width of both hidden layers.
            generator: Source of the initial parameters, on the CPU.
        """
        super().__init__()
        self.first = PerRobotLinear(num_robots, num_robots * obs_width, hidden_width, generator)
        self.second = PerRobotLinear(num_robots, hidden_width, hidden_width, generator)
        self.output = PerRobotLinear(num_robots, hidden_width, outputs, generator)

    def forward(
        self, obs: Tensor, actions: Tensor, available: Tensor | None = None
    ) -> CriticOutput:
        """Value the state.

        Args:
            obs: (R, B, D) observations; every robot's values depend on all of them.
            actions: (R, B) int64; not used, as in other critics' signature.
            available: (B, R) bool; not used either.
        """
        del actions, available
        joint = obs.transpose(0, 1).flatten(1)  # (B, R * D)
        joint = joint.expand(len(obs), -1, -1)
        hidden = functional.leaky_relu_(self.first(joint))
        hidden = functional.leaky_relu_(self.second(hidden))
        return CriticOutput(self.output.batch_last(hidden), None)


class CentralCritic(nn.Module):
    """One network for the whole team, with two hidden layers and an output for each robot.

    A state is one row, not one for each robot: the cheapest critic there is.
    """

    def __init__(
        self,
        num_robots: int,
        obs_width: int,
        outputs: int,
        hidden_width: int,
        generator: torch.Generator,
    ) -> None:
        """Draw the parameters; arguments as in `JointCritic`."""
        super().__init__()
        self.num_robots = num_robots
        self.first = PerRobotLinear(1, num_robots * obs_width, hidden_width, generator)
        self.second = PerRobotLinear(1, hidden_width, hidden_width, generator)
        self.output = PerRobotLinear(1, hidden_width, num_robots * outputs, generator)

    def forward(
        self, obs: Tensor, actions: Tensor, available: Tensor | None = None
    ) -> CriticOutput:
        """Value the state; arguments as in `JointCritic.forward`."""
        del actions, available
        joint = obs.transpose(0, 1).flatten(1).unsqueeze(0)  # (1, B, R * D)
        hidden = functional.leaky_relu_(self.first(joint))
        hidden = functional.leaky_relu_(self.second(hidden))
        values = self.output.batch_last(hidden)
        return CriticOutput(values.view(self.num_robots, -1, values.shape[2]), None)
