"""How much the seed of a run says about which food robot does more, whatever its attention.

Runs of one seed begin with the same weights and meet the same worlds, in training and when they are
measured. Where they agree across arms on who does more, a paper with one run for each method prints
a difference of seeds as if it were one of methods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import f as fisher

from innerattn.experiments.crossed.arms import CREDITS, CROSSED, Credit
from innerattn.experiments.crossed.effects import LEAST_SEEDS
from innerattn.experiments.crossed.outcome import Outcomes, by_seed
from innerattn.stats import Estimate


@dataclass(frozen=True)
class SeedEffect:
    """The share of all rescues by the first food robot, in the runs of one credit.

    Attributes:
        credit: who is rewarded for a rescue.
        arms: number of arms, which differ by their attention only.
        seeds: number of seeds with a run of each arm.
        correlation: of runs of one seed, see `intraclass_correlation`; None where it is undefined.
        least: smallest share of a run; None without runs.
        most: largest share.
    """

    credit: Credit
    arms: int
    seeds: int
    correlation: Estimate | None
    least: float | None
    most: float | None


def seed_effects(outcomes: Outcomes) -> list[SeedEffect]:
    """Of both credits, over the crossed arms."""
    return [_seed_effect(credit, outcomes) for credit in CREDITS]


def _seed_effect(credit: Credit, outcomes: Outcomes) -> SeedEffect:
    arms = [arm for arm in CROSSED if arm.credit == credit]
    shares = by_seed(outcomes, arms, "first_share")
    least, most = (float(shares.min()), float(shares.max())) if len(shares) else (None, None)
    enough = len(shares) >= LEAST_SEEDS
    correlation = intraclass_correlation(shares) if enough else None
    return SeedEffect(credit, len(arms), len(shares), correlation, least, most)


def intraclass_correlation(values: ArrayLike) -> Estimate | None:
    """How alike the runs of one seed are, each arm's mean taken away: 1 the same, 0 not alike.

    ICC(3,1) of Shrout & Fleiss (1979), "Intraclass correlations: uses in assessing rater
    reliability": the share of the variance of single runs that lies between seeds,
    ``(S - E) / (S + (k - 1) E)``, with mean squares S between seeds and E of what neither seed nor
    arm explains.

    Args:
        values: (n, k) a row for each seed, n >= 2, and a column for each arm, k >= 2.

    Returns:
        The correlation and its exact 95 % interval by the F distribution; None where E is 0.

    Raises:
        ValueError: there are fewer than two seeds or arms.
    """
    rows = np.asarray(values, np.float64)
    if rows.ndim != 2 or min(rows.shape) < 2:
        raise ValueError(f"values of shape {rows.shape}: must be (n, k), both 2 or more")
    n, k = rows.shape
    seeds = rows.mean(axis=1, keepdims=True)
    left = rows - seeds - rows.mean(axis=0) + rows.mean()
    free, free_left = n - 1, (n - 1) * (k - 1)
    between = k * float(((seeds - rows.mean()) ** 2).sum()) / free
    error = float((left**2).sum()) / free_left
    if error <= 1e-12 * max(between, 1.0):
        return None
    ratio = between / error
    low = ratio / float(fisher.ppf(0.975, free, free_left))
    high = ratio * float(fisher.ppf(0.975, free_left, free))
    return Estimate(*((r - 1.0) / (r + k - 1.0) for r in (ratio, low, high)))
