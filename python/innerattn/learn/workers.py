"""The processes that train one learner together, as its updates see them.

Each has a share of the worlds, and the same weights. What an update learns from, gradients and
statistics, is averaged over all of them, and every process gets the same bits. Who starts them and
how they exchange tensors is not known here; without others, everything stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from innerattn.learn.adam import Gradients


class Workers(Protocol):
    """All workers of a training, of which this process is one. All of them make the same calls.

    Attributes:
        rank: Number of this one, from 0.
        count: How many there are.
    """

    rank: int
    count: int

    def gather(self, values: Tensor) -> Tensor:
        """The values of all workers, in the order of their ranks.

        Args:
            values: (n,) on the CPU, of one length and dtype everywhere.

        Returns:
            (W, n), equal to the bit for all.
        """


class Alone:
    """One worker."""

    rank, count = 0, 1

    def gather(self, values: Tensor) -> Tensor:
        """The values, as (1, n)."""
        return values.unsqueeze(0)


_present: Workers = Alone()


@contextmanager
def joined(workers: Workers) -> Iterator[None]:
    """Let learners that are built inside the block, and what they learn, be those of ``workers``.

    A process is one worker, so this holds for the process.
    """
    global _present
    before, _present = _present, workers
    try:
        yield
    finally:
        _present = before


def rank() -> int:
    """Number of this worker, from 0."""
    return _present.rank


def count() -> int:
    """How many workers train together."""
    return _present.count


def share_of(whole: int) -> int:
    """The part of ``whole`` that each worker has, such as worlds or rows; at least 1."""
    return max(1, whole // _present.count)


def own_seed(seed: np.random.SeedSequence) -> np.random.SeedSequence:
    """The seed of this worker's draws: that of worker 0 is ``seed``."""
    return seed if _present.rank == 0 else seed.spawn(_present.rank)[-1]


def gathered(values: Tensor) -> Tensor:
    """The values of all workers, (W, ...), in the order of ranks.

    They stay as they are until the exchange after the next one.
    """
    found = _present.gather(values.detach().reshape(-1).cpu())
    return found.view(-1, *values.shape).to(values.device)


def of_first(values: Tensor) -> Tensor:
    """The values of worker 0."""
    return values if _present.count == 1 else gathered(values)[0].clone()


def total(values: Tensor) -> Tensor:
    """Sum over all workers, of any shape; in the order of ranks, so that all get the same bits."""
    return values if _present.count == 1 else gathered(values).sum(dim=0)


def mean(values: Tensor) -> Tensor:
    """Mean over all workers, of any shape."""
    return values if _present.count == 1 else total(values) / _present.count


def largest(values: Tensor) -> Tensor:
    """The largest over all workers, of any shape."""
    return values if _present.count == 1 else gathered(values).amax(dim=0)


def averaged(
    gradients: Sequence[Gradients], numbers: Sequence[Tensor]
) -> tuple[list[Gradients], list[Tensor]]:
    """Means over all workers of gradients and numbers of one dtype, in a single exchange.

    Args:
        gradients: Of some networks, by name.
        numbers: Of any shapes.

    Returns:
        The same, averaged; what was given where there is one worker.
    """
    if _present.count == 1:
        return list(gradients), list(numbers)
    parts = [part for one in gradients for part in one.values()]
    packed = torch.cat([part.reshape(-1) for part in (*parts, *numbers)])
    found = torch.ops.innerattn.mean_over_workers(packed)
    sizes = [part.numel() for part in (*parts, *numbers)]
    means = iter(found.split_with_sizes(sizes))
    averages = [
        {name: next(means).view(part.shape) for name, part in one.items()} for one in gradients
    ]
    return averages, [next(means).view(number.shape) for number in numbers]


@torch.library.custom_op("innerattn::mean_over_workers", mutates_args=())
def _mean_over_workers(values: Tensor) -> Tensor:
    """Mean (n,) over all workers: an operator of its own, so that a compiled graph can hold it."""
    return gathered(values).mean(dim=0)


@_mean_over_workers.register_fake
def _(values: Tensor) -> Tensor:
    return torch.empty_like(values)
