"""How a pair sums up other robots' pairs at the same victim: by attention, mean, max or nearest."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from math import prod

import torch
from torch import Tensor, nn

_LARGEST_LOGIT = 20.0


class Pooling(nn.Module, ABC):
    """One way to pool; it does not depend on how many there are, nor on their order."""

    def __init__(self, width: int, key_width: int) -> None:
        """Pool rows of ``width`` numbers; ``key_width`` is the width of keys, if there are any."""
        super().__init__()
        self.width, self.key_width = width, key_width

    @abstractmethod
    def forward(
        self, rows: Tensor, table: Tensor, cells: Tensor, masks: Tensor, times: Tensor
    ) -> Tensor:
        """Pool what masks show to each row.

        Args:
            rows: (P, H).
            table: (M, R, H) the same, as of `as_table`.
            cells: (P,) int64, where each row stands in a table of (M, R).
            masks: (M, R, R) bool, whom each robot looks at.
            times: (M, R) arrival times [s].

        Returns:
            (P, H); zeros for a row that looks at nobody.
        """


def as_table(rows: Tensor, cells: Tensor, *sizes: int) -> Tensor:
    """Rows (P, H) as a table (*sizes, H), zeros where ``cells`` (P,) names none."""
    table = rows.new_zeros(prod(sizes), rows.shape[1])
    return table.index_copy_(0, cells, rows).view(*sizes, rows.shape[1])


class InnerPooling(Pooling):
    """softmax over k of q_i . k_k / sqrt(d), by learnt queries and keys (MAAC, eq. 6)."""

    def __init__(self, width: int, key_width: int) -> None:
        """See `Pooling`."""
        super().__init__(width, key_width)
        self.query = nn.Linear(width, key_width)
        self.key = nn.Linear(width, key_width, bias=False)

    def forward(
        self, rows: Tensor, table: Tensor, cells: Tensor, masks: Tensor, times: Tensor
    ) -> Tensor:
        """See `Pooling.forward`."""
        del times
        sizes = masks.shape[:2]
        query, key = (as_table(one(rows), cells, *sizes) for one in (self.query, self.key))
        logits = query @ key.transpose(1, 2) * self.key_width**-0.5
        # A largest logit instead of the row's own maximum: no row of the mask need have an entry.
        weights = logits.clamp(max=_LARGEST_LOGIT).exp() * masks
        weights = weights / (weights.sum(-1, keepdim=True) + 1e-9)
        found: Tensor = (weights @ table).flatten(0, 1).index_select(0, cells)
        return found


class UniformPooling(Pooling):
    """The mean over all that a row looks at: uniform weights."""

    def forward(
        self, rows: Tensor, table: Tensor, cells: Tensor, masks: Tensor, times: Tensor
    ) -> Tensor:
        """See `Pooling.forward`."""
        del rows, times
        weights = masks.to(table.dtype)
        weights = weights / weights.sum(-1, keepdim=True).clamp(min=1.0)
        return (weights @ table).flatten(0, 1).index_select(0, cells)


class MaxPooling(Pooling):
    """The largest of each number over all that a row looks at."""

    def forward(
        self, rows: Tensor, table: Tensor, cells: Tensor, masks: Tensor, times: Tensor
    ) -> Tensor:
        """See `Pooling.forward`."""
        del rows, times
        size = masks.shape[1]
        there = table.index_select(0, cells // size)  # (P, R, H)
        seen = masks.flatten(0, 1).index_select(0, cells)[..., None]
        found = there.masked_fill(~seen, -torch.inf).amax(1)
        return torch.where(seen.any(1), found, 0.0)


class NearestPooling(Pooling):
    """The one that is there first, of all that a row looks at."""

    def forward(
        self, rows: Tensor, table: Tensor, cells: Tensor, masks: Tensor, times: Tensor
    ) -> Tensor:
        """See `Pooling.forward`."""
        del rows
        size = masks.shape[1]
        seen = masks.flatten(0, 1).index_select(0, cells)
        others = times.index_select(0, cells // size).masked_fill(~seen, torch.inf)
        nearest = cells // size * size + others.argmin(-1)
        found = table.flatten(0, 1).index_select(0, nearest)
        return found * seen.any(-1, keepdim=True)


POOLINGS: Mapping[str, type[Pooling]] = {
    "inner": InnerPooling,
    "uniform": UniformPooling,
    "max": MaxPooling,
    "nearest": NearestPooling,
}
"""All poolings by name."""
