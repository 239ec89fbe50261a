"""How to sum up those of several vectors that are there, without parameters and in any order."""

from __future__ import annotations

import torch
from torch import Tensor


def equal_weights(there: Tensor, dim: int, dtype: torch.dtype) -> Tensor:
    """Weights of a mean: 1/n for each of the n that are there, 0 for the others.

    Args:
        there: Bool, of any shape.
        dim: The dimension along which weights add up to 1, or to 0 where none is there.
        dtype: Of the weights.
    """
    return there.to(dtype) / there.sum(dim=dim, keepdim=True).clamp_min(1)


def mean(values: Tensor, there: Tensor, dim: int) -> Tensor:
    """The mean of those that are there, 0 where none is; one division for each number of it.

    Args:
        values: Of any shape.
        there: Bool, of a shape that broadcasts to that of ``values``.
        dim: The dimension to pool; the result lacks it.
    """
    weights = there.to(values.dtype)
    return (weights * values).sum(dim=dim) / weights.sum(dim=dim).clamp_min(1.0)


def largest(values: Tensor, there: Tensor, dim: int) -> Tensor:
    """The largest of each number, of those that are there; 0 where none is.

    Args:
        values: Of any shape.
        there: Bool, of a shape that broadcasts to that of ``values``.
        dim: The dimension to pool; the result lacks it.
    """
    lowest = torch.finfo(values.dtype).min
    found = values.masked_fill(~there, lowest).amax(dim=dim)
    return found.masked_fill(~there.any(dim=dim), 0.0)


def nearest_one(there: Tensor, distances: Tensor) -> Tensor:
    """The nearest of those that are there, the first of equally near ones.

    Args:
        there: (R, K, B) bool.
        distances: (R, K, B), or any number that grows with distance.

    Returns:
        (R, K, B) bool, of which at most one of the K is set.
    """
    nearest = distances.masked_fill(~there, torch.inf).argmin(dim=1, keepdim=True)
    slots = torch.arange(there.shape[1], device=there.device).view(-1, 1)
    return there & (slots == nearest)
