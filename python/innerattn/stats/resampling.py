"""The bootstrap over episodes: what resampling gives, and percentile intervals of it.

Rescues within an episode depend on each other, episodes do not, so whole episodes are resampled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.estimate import Estimate

Array = NDArray[np.float64]

_RESAMPLES = 4000
_CHUNK = 2**21  # indices drawn at once, 16 MB
_LOW, _HIGH = 2.5, 97.5


@dataclass(frozen=True)
class Resampled:
    """Numbers and the values that a bootstrap gives for them.

    Attributes:
        value: (...) float64.
        resampled: (..., B) float64, of each resample.
    """

    value: Array
    resampled: Array

    def __getitem__(self, index: int | slice | tuple[int | slice, ...]) -> Resampled:
        """The same of a part, by an index into ``value``."""
        return Resampled(np.asarray(self.value[index]), np.asarray(self.resampled[index]))

    def __sub__(self, other: Resampled) -> Resampled:
        """The difference; paired, if both come from the same resampling."""
        return Resampled(self.value - other.value, self.resampled - other.resampled)

    def mean(self, axis: int | tuple[int, ...]) -> Resampled:
        """The mean along axes of ``value``, counted from the first."""
        return Resampled(self.value.mean(axis), self.resampled.mean(axis))

    def estimate(self) -> Estimate:
        """The value of a single number with its 95 % interval.

        Where a resample has no value (NaN), the interval is unbounded.
        """
        if np.isnan(self.resampled).any():
            return Estimate(float(self.value))
        return percentile_interval(float(self.value), self.resampled)


def resampled_means(
    columns: NDArray[np.float64], seed: int, resamples: int = _RESAMPLES
) -> NDArray[np.float64]:
    """Means of resampled rows; a row is drawn as a whole, so columns stay paired.

    Args:
        columns: (n, C) one row per episode.
        seed: seed of the resampling.
        resamples: how many.

    Returns:
        (resamples, C) float64.
    """
    n = len(columns)
    rng = np.random.default_rng(seed)
    means = np.empty((resamples, columns.shape[1]))
    step = max(1, _CHUNK // n)
    for start in range(0, resamples, step):
        rows = rng.integers(0, n, (min(step, resamples - start), n))
        for column, values in enumerate(columns.T):
            means[start : start + step, column] = values[rows].mean(1)
    return means


def resampled_counts(n: int, seed: int, resamples: int = _RESAMPLES) -> NDArray[np.float64]:
    """How often each of ``n`` episodes is drawn in each resample of a bootstrap.

    The mean of a resample is ``counts @ values / n``. It is faster than `resampled_means` where
    many figures are of the same episodes, and keeps them all paired.

    Args:
        n: number of episodes.
        seed: seed of the resampling.
        resamples: how many, S.

    Returns:
        (S, n) float64 whole numbers; every row sums to n.
    """
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), resamples)
    return drawn.astype(np.float64)


def percentile_interval(mean: float, resampled: NDArray[np.float64]) -> Estimate:
    """A mean, and the middle 95 % of what resampling (S,) made of it."""
    low, high = np.percentile(resampled, (_LOW, _HIGH))
    return Estimate(float(mean), float(low), float(high))
