"""One set of parameters for all robots of a kind.

The layers of a network go on seeing a row of weights for each robot; which rows are one and the
same is decided here.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn.utils import parametrize

from innerattn.nn.linear import PerRobotLinear


def share_by_kind(network: nn.Module, kinds: Sequence[str]) -> None:
    """Let robots of a kind have the same weights in all layers that have weights by robot.

    A kind begins with the weights of its first robot. The network's parameters then have kinds
    instead of robots as their first dimension, (K, ...), and ``parametrizations.weight.original``
    instead of ``weight`` in their names; a kind's gradient is the sum of its robots'.

    Args:
        network: Changed in place; before its optimiser is made.
        kinds: Of each robot, R words.
    """
    rows = _RowsByKind(kinds)
    for layer in [one for one in network.modules() if isinstance(one, PerRobotLinear)]:
        for name in ("weight", "bias"):
            parametrize.register_parametrization(layer, name, rows)


class _RowsByKind(nn.Module):
    """From parameters by kind (K, ...) to parameters by robot (R, ...), and back.

    Rows are taken one by one: the gradient of an index adds up in any order on several threads.
    """

    def __init__(self, kinds: Sequence[str]) -> None:
        super().__init__()
        names = list(dict.fromkeys(kinds))
        self._kind = [names.index(kind) for kind in kinds]
        self._first = [list(kinds).index(name) for name in names]

    def forward(self, by_kind: Tensor) -> Tensor:
        rows = by_kind.unbind()
        return torch.stack([rows[kind] for kind in self._kind])

    def right_inverse(self, by_robot: Tensor) -> Tensor:
        return torch.stack([by_robot[robot] for robot in self._first])
