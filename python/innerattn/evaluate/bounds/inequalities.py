"""How far attention may move when one robot's input moves: the two sides of every inequality.

Pure functions of tensors. A logit is S_ij = q_i . k_j / sqrt(d), what the softmax takes. Robot j,
the first dimension, is the one that is changed. The proofs are in docs/attention-bound.md.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.evaluate.bounds.response import Response

TOLERANCE = 1e-10
"""Excess over a bound, as a share of 1 + bound, that is taken for float64 rounding."""

Sides = tuple[Tensor, Tensor]
"""What was measured, and its bound; one shape."""


class LogitSlopes(NamedTuple):
    """How logits depend on the encoding e of the changed robot: each is g . e.

    Attributes:
        directions: (R, H, B, W) g of each other robot.
        by_norms: (B, H, R) the product of norms that is at least ||g||.
        sharp: (B, H, R) ||g|| itself.
    """

    directions: Tensor
    by_norms: Tensor
    sharp: Tensor


def head_norms(matrix: Tensor, heads: int) -> Tensor:
    """Spectral norm of each head's rows.

    Args:
        matrix: (W, W), rows h*d..(h+1)*d belong to head h.
        heads: H, a divisor of W.

    Returns:
        (H,).
    """
    norms: Tensor = torch.linalg.matrix_norm(_by_head(matrix, heads), ord=2)
    return norms


def logit_slopes(fixed: Tensor, near: Tensor, far: Tensor, heads: int) -> LogitSlopes:
    """The slopes g = far_h^T near_h fixed / sqrt(d) for every head h.

    With e_i^s as what is fixed, the query as ``near`` and the key as ``far`` they give
    S_ij = g_i . e_j; with e_k, the key and the query S_jk = g_k . e_j^s.

    Args:
        fixed: (R, B, W) encodings that stay as they are.
        near: (W, W) the matrix that is applied to them.
        far: (W, W) the matrix that is applied to what changes.
        heads: H.
    """
    near_blocks, far_blocks = _by_head(near, heads), _by_head(far, heads)
    scale = near_blocks.shape[1] ** -0.5
    projected = torch.einsum("rbw,hdw->rbhd", fixed, near_blocks)
    directions = torch.einsum("rbhd,hdw->rhbw", projected, far_blocks) * scale
    norms = head_norms(near, heads) * head_norms(far, heads) * scale
    return LogitSlopes(
        directions,
        norms.unsqueeze(1) * fixed.norm(dim=2).t().unsqueeze(1),
        directions.norm(dim=3).permute(2, 1, 0),
    )


def largest_weight_change(logit_spread: Tensor) -> Tensor:
    """tanh(r / 4): no softmax weight, and no sum of weights, changes by more.

    Args:
        logit_spread: r >= 0, the largest minus the smallest change of a logit of the row: |dS|
            where one logit alone moves, at most 2 D where none moves by more than D.
    """
    return torch.tanh(logit_spread / 4.0)


def teammates_sides(response: Response, slopes: LogitSlopes, reach: Tensor) -> dict[str, Sides]:
    """The inequalities about rows i != j, in which logit ij alone moves.

    Args:
        response: what was measured; its logits exist.
        slopes: of S_ij in e_j, by robot i.
        reach: (R, M, B) length of the change of e_j.

    Returns:
        (R, M, B, H, R) both sides by name; the entry i = j means nothing.
    """
    assert response.logits is not None
    assert response.weights is not None
    logits, weights = response.logits.abs(), response.weights.abs()
    by_norms = reach[..., None, None] * slopes.by_norms
    return {
        "logit": (logits, by_norms),
        "logit_sharp": (logits, reach[..., None, None] * slopes.sharp),
        "weight": (weights, largest_weight_change(logits)),
        "weight_by_norms": (weights, largest_weight_change(by_norms)),
    }


def own_row_sides(response: Response, slopes: LogitSlopes, reach: Tensor) -> dict[str, Sides]:
    """The inequalities about row j, in which every logit moves since the query does.

    Args:
        response: what was measured; its logits exist.
        slopes: of S_jk in e_j^s, by robot k.
        reach: (R, M, B) length of the change of e_j^s.

    Returns:
        Both sides by name: of logits (R, M, B, H, R), of which the entry k = j means nothing, and
        of whole rows (R, M, B, H, 1).
    """
    assert response.own_logits is not None
    assert response.own_weights is not None
    moved = response.own_logits
    itself = torch.eye(len(moved), dtype=torch.bool)[:, None, None, None]
    highest = moved.masked_fill(itself, -torch.inf).amax(-1, keepdim=True)
    lowest = moved.masked_fill(itself, torch.inf).amin(-1, keepdim=True)
    farthest = torch.maximum(highest.abs(), lowest.abs())
    shifted = response.own_weights.abs().sum(-1, keepdim=True) / 2.0
    return {
        "own_logit": (moved.abs(), reach[..., None, None] * slopes.by_norms),
        "own_logit_sharp": (moved.abs(), reach[..., None, None] * slopes.sharp),
        "own_row": (shifted, largest_weight_change(2.0 * farthest)),
        "own_row_sharp": (shifted, largest_weight_change(highest - lowest)),
    }


def violated(measured: Tensor, bound: Tensor) -> Tensor:
    """Where a bound is exceeded by more than `TOLERANCE` times 1 + bound, or a side is NaN."""
    return ~(measured <= bound + TOLERANCE * (1.0 + bound))


def _by_head(matrix: Tensor, heads: int) -> Tensor:
    """PolicyInput (W, W) as (H, d, W)."""
    return matrix.view(heads, -1, matrix.shape[1])
