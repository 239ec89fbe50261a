"""One set of parameters for all robots of a kind.

The layers of a network still see a row of weights for each robot; this module decides which rows
are the same.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn.utils import parametrize

from innerattn.nn.linear import PerRobotLinear


def share_by_kind(network: nn.Module, kinds: Sequence[str]) -> None:
    """Let robots of a kind share the parameters of all layers that have weights by robot.

    The first robot of a kind gives the initial weights of the kind. The network's parameters then
    have kinds instead of robots as their first dimension, (K, ...), in the order in which kinds
    first occur, and ``parametrizations.weight.original`` instead of ``weight`` in their names. The
    gradient of a kind is the sum of the gradients of its robots.

    Args:
        network: Changed in place; before its optimiser is made.
        kinds: Of each robot, R words.
    """
    rows = _RowsByKind(kinds)
    for layer in [one for one in network.modules() if isinstance(one, PerRobotLinear)]:
        for name in ("weight", "bias"):
            parametrize.register_parametrization(layer, name, rows)


def is_shared_by_kind(name: str) -> bool:
    """Whether a parameter of this name has kinds as its first dimension."""
    return ".parametrizations." in name


def robots_of_each_kind(kinds: Sequence[str]) -> Tensor:
    """(K,) int64, the number of robots of each kind, in the order of `share_by_kind`."""
    return torch.tensor(list(Counter(kinds).values()))


class _RowsByKind(nn.Module):
    """From parameters by kind (K, ...) to parameters by robot (R, ...), and back.

    Rows are taken one by one: on several threads, the gradient of an index sums in any order.
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
