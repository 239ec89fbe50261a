"""Additive attention over teammates: scores u . tanh(W_q e_i + W_k e_j) instead of products.

Source: Bahdanau et al. 2015, "Neural Machine Translation by Jointly Learning to Align and
Translate", appendix A.1.2.
"""

import torch
from torch import Tensor
from torch.nn import functional

from innerattn.nn import Attended, TeammateAttention
from innerattn.nn.attention import visible_teammates
from innerattn.nn.linear import uniform_parameter


class AdditiveAttention(TeammateAttention):
    """alpha_ij = softmax over j != i of u . tanh(W_q e_i + W_k e_j), per head.

    Attributes:
        query: (W, W), likewise `key` and `value`; rows h*d..(h+1)*d belong to head h.
        score: (H, d) u of each head.
    """

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Draw the parameters; arguments as in `TeammateAttention`."""
        super().__init__(width, heads, generator)
        self.query = uniform_parameter((width, width), width, generator)
        self.key = uniform_parameter((width, width), width, generator)
        self.value = uniform_parameter((width, width), width, generator)
        self.score = uniform_parameter((heads, width // heads), width // heads, generator)

    def forward(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> Attended:
        """Attend to teammates; arguments as in `TeammateAttention.forward`."""
        robots, batch, width = own.shape
        by_head = (robots, batch, self.heads, width // self.heads)
        queries = functional.linear(own, self.query).view(by_head)
        keys = functional.linear(others, self.key).view(by_head)
        values = functional.leaky_relu(functional.linear(others, self.value)).view(by_head)
        # Robots i are the first dimension, teammates j the second: (R, R, B, H).
        scores = (torch.tanh(queries.unsqueeze(1) + keys.unsqueeze(0)) * self.score).sum(dim=4)
        visible = visible_teammates(robots, available, own.device)
        seen = visible.permute(1, 2, 0).unsqueeze(3)
        weights = scores.masked_fill(~seen, torch.finfo(scores.dtype).min).softmax(dim=1) * seen
        mixed = (weights.unsqueeze(4) * values.unsqueeze(0)).sum(dim=1)
        return Attended(
            mixed=mixed.view(robots, batch, width),
            weights=weights.permute(2, 3, 0, 1),
            scores=scores.permute(2, 3, 0, 1),
            visible=visible,
        )
