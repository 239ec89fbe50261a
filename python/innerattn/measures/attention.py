"""How attentive attention is: its entropy by robot and head, from recorded weights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.records.record import Record


@dataclass(frozen=True)
class Entropy:
    """Entropy of attention, averaged over all recorded steps.

    Attributes:
        nats: (R, H) float64.
        share: (R, H) float64 of ln(R - 1), the entropy of even attention; NaN for less than three
            robots, where there is nothing to choose.
        teammates: (R, H) float64 exp(nats), how many teammates are attended to in effect.
    """

    nats: NDArray[np.float64]
    share: NDArray[np.float64]
    teammates: NDArray[np.float64]


def entropy_of(record: Record) -> Entropy | None:
    """The entropy of a record's attention; None where none was recorded.

    Steps after the end of an episode do not count.
    """
    weights = record.steps.get("attention")
    if weights is None:
        return None
    happened = np.arange(weights.shape[1]) < record.lengths[:, None]
    nats = attention_entropy(weights[happened])
    robots = len(nats)
    even = math.log(robots - 1) if robots > 2 else math.nan
    return Entropy(nats, nats / even, np.exp(nats))


def attention_entropy(weights: NDArray[np.float32]) -> NDArray[np.float64]:
    """Mean entropy of attention by robot and head, in nats.

    Args:
        weights: (..., H, R, R) attention weights; row i holds robot i's over its teammates.

    Returns:
        (R, H) float64; 0 for a robot alone, ln(R - 1) for a robot that attends evenly.
    """
    *batch, heads, robots, _ = weights.shape
    # float32 softmax of far-apart logits gives exact zeros, whose share of the entropy is 0.
    w = weights.reshape(math.prod(batch), heads, robots, robots).astype(np.float64)
    terms = w * np.log(np.where(w > 0.0, w, 1.0))
    return np.asarray(-terms.sum(-1).mean(0).T + 0.0)
