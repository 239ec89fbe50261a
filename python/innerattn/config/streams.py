"""Seeds of random streams: training and evaluation never draw from the same ones."""

from __future__ import annotations

from typing import Literal

Purpose = Literal["training", "evaluation"]

_MOST_SEED = 2**63
_FIRST_EVALUATION_SEED = 10_000


def stream_seed(seed: int, purpose: Purpose) -> int:
    """The seed of all random streams of a training or of an evaluation.

    No seed of a training gives a seed that some evaluation has, so a team is never measured in
    worlds in which it was trained. Seeds below 10,000 of a training and all others of an evaluation
    are taken as they are; 2**63 is added to the rest.

    Args:
        seed: `train.seed` or `evaluate.seed`, 0 to 2**63 - 1.
        purpose: what it is the seed of.

    Raises:
        ValueError: a seed out of range.
    """
    if not 0 <= seed < _MOST_SEED:
        raise ValueError(f"seed = {seed}: must be in 0..={_MOST_SEED - 1}")
    as_it_is = (seed < _FIRST_EVALUATION_SEED) == (purpose == "training")
    return seed if as_it_is else seed + _MOST_SEED
