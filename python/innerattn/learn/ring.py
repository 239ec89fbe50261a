"""The newest rows of a stream that only grows, in memory of a fixed size."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor


class Ring:
    """Rows of one or more columns: row number n of the stream lies at place n mod capacity.

    Rows that were held once never change, so that whoever copies the new ones now and then has
    copied all.

    Attributes:
        columns: Tensors (capacity, ...) by name.
        seen: Rows of the stream so far.
    """

    def __init__(self, **columns: Tensor) -> None:
        """Hold nothing yet in the memory of ``columns``, which are equally long."""
        self.columns: Mapping[str, Tensor] = columns
        self.seen = 0

    @property
    def capacity(self) -> int:
        """Rows held at most."""
        return len(next(iter(self.columns.values())))

    @property
    def held(self) -> int:
        """Rows held now, the newest."""
        return min(self.seen, self.capacity)

    @property
    def row_bytes(self) -> int:
        """Size of a row."""
        return sum(column[0].nbytes for column in self.columns.values())

    def rows(self, first: int, count: int) -> dict[str, Tensor]:
        """Copies on the CPU of rows ``first`` to ``first + count - 1``.

        Raises:
            ValueError: Not all of them are held.
        """
        if not self.seen - self.held <= first <= first + count <= self.seen:
            raise ValueError(f"rows {first} to {first + count}: are not all held")
        places = (first + torch.arange(count)) % self.capacity
        return {
            name: column.index_select(0, places.to(column.device)).cpu()
            for name, column in self.columns.items()
        }

    def put(self, first: int, rows: Mapping[str, Tensor]) -> None:
        """Put rows back that `rows` gave; those that are no longer held are left out.

        Args:
            first: The number of the first of them.
            rows: Columns by name. `seen` must be set before.

        Raises:
            ValueError: A column is missing, or of another shape or dtype.
        """
        if rows.keys() != self.columns.keys():
            raise ValueError(f"columns {sorted(rows)}: must be {sorted(self.columns)}")
        count = len(next(iter(rows.values())))
        for name, column in self.columns.items():
            given, wanted = rows[name], (count, *column.shape[1:])
            if tuple(given.shape) != wanted or given.dtype != column.dtype:
                raise ValueError(
                    f"column {name!r} is {given.dtype} {tuple(given.shape)}: must be "
                    f"{column.dtype} {wanted}"
                )
        numbers = first + torch.arange(count)
        kept = (numbers >= self.seen - self.held) & (numbers < self.seen)
        for name, column in self.columns.items():
            places = (numbers[kept] % self.capacity).to(column.device)
            column.index_copy_(0, places, rows[name][kept].to(column.device))
