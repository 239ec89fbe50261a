"""A network that scores the tasks that could come next in an order, by attention between them."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from innerattn.policies.orders.network import HEADS, LARGEST, SHUT, layer_shapes


class OrderNetwork(nn.Module):
    """Scores of open tasks; `innerattn.policies.orders.network` is the same in numpy.

    A task's features become a row; open tasks attend to each other, with a bias for each pair and
    head for how the two are related (Vaswani et al. 2017, with layers normed first).
    """

    def __init__(self, width: int = 64) -> None:
        """Draw the weights.

        Args:
            width: of hidden layers, a multiple of the number of heads.
        """
        super().__init__()
        self.width = width
        for name, shape in layer_shapes(width).items():
            layer, _, part = name.partition(".")
            if part == "weight":
                made = nn.LayerNorm(width) if len(shape) == 1 else nn.Linear(shape[1], shape[0])
                self.add_module(layer, made)

    def forward(self, features: Tensor, relations: Tensor, is_open: Tensor) -> Tensor:
        """Scores (B, T); that of a task which is not open is a large negative number.

        Args:
            features: float32 (B, T, F) of `_core.Orders.features`.
            relations: float32 (B, T, T, 2) of `relations_of`.
            is_open: bool (B, T), whether a task could come next.
        """
        layer = self.get_submodule
        rows = layer("first")(features.clamp(-float(LARGEST), float(LARGEST)))
        rows = layer("second")(torch.relu(rows))
        heads = (*features.shape[:2], 3, HEADS, self.width // HEADS)
        asked = layer("attend")(layer("attend_norm")(rows)).view(heads)
        query, key, value = asked.permute(2, 0, 3, 1, 4)
        shut = torch.zeros(is_open.shape).masked_fill(~is_open, float(SHUT))
        bias = layer("relate")(relations).permute(0, 3, 1, 2) + shut[:, None, None, :]
        pooled = nn.functional.scaled_dot_product_attention(query, key, value, attn_mask=bias)
        rows = rows + layer("join")(pooled.transpose(1, 2).reshape(rows.shape))
        rows = rows + layer("narrow")(torch.relu(layer("widen")(layer("widen_norm")(rows))))
        rows = torch.relu(layer("last")(layer("last_norm")(rows)))
        return Tensor(layer("score")(rows)).squeeze(-1).masked_fill(~is_open, float(SHUT))
