"""Linear layers: one for all robots, and one that is made of each robot's body."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

BODY_WIDTH = 3
_HIDDEN = 32


def layer(inputs: int, outputs: int, gain: float = 2.0**0.5) -> nn.Linear:
    """A linear layer with orthogonal weights and no bias at first."""
    made = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(made.weight, gain)
    nn.init.zeros_(made.bias)
    return made


class BodyLayer(nn.Module):
    """y = W_i x + b_i, where a network makes W_i and b_i of robot i's body: a hypernetwork.

    So the last layer of the policy is made in "Capability-Aware Shared Hypernetworks" (CASH, CoRL
    2025), there also of what the robot sees. All robots begin with nearly the same weights.
    """

    def __init__(self, inputs: int, outputs: int, gain: float) -> None:
        """Draw weights; ``gain`` is that of W at first."""
        super().__init__()
        self.outputs = outputs
        self.body = layer(BODY_WIDTH, _HIDDEN)
        self.made = layer(_HIDDEN, outputs * (inputs + 1), 0.1 * gain)
        first = nn.init.orthogonal_(torch.empty(outputs, inputs), gain)
        self.made.bias.data = functional.pad(first, (0, 1)).flatten()

    def forward(self, rows: Tensor, robots: Tensor, bodies: Tensor) -> Tensor:
        """Map rows (P, inputs) of robots (P,) int64 with bodies (N, 3) to (P, outputs)."""
        made = self.made(functional.relu(self.body(bodies)))
        of_rows = made.index_select(0, robots).view(len(rows), self.outputs, -1)
        products = (of_rows[..., :-1] @ rows[..., None]).squeeze(-1)
        found: Tensor = products + of_rows[..., -1]
        return found
