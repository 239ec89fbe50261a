"""Percentile bootstraps. They resample whole episodes, or whole runs.

Rescues within an episode depend on each other, episodes do not, so an episode is the smallest unit
that is resampled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.stats.estimate import Estimate

Array = NDArray[np.float64]

RESAMPLES = 4000
"""Resamples of a bootstrap over episodes."""

_LOW, _HIGH = 2.5, 97.5  # percentiles
_CHUNK = 2**21  # numbers drawn at once, 16 MB


@dataclass(frozen=True)
class Resampled:
    """Numbers, and their values in each resample of a bootstrap.

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
        """A single number with its 95 % interval.

        The interval is unbounded where a resample has no value (NaN).
        """
        if np.isnan(self.resampled).any():
            return Estimate(float(self.value))
        return percentile_interval(float(self.value), self.resampled)


def percentile_interval(mean: float, resampled: Array) -> Estimate:
    """A number with the middle 95 % of its values in resamples (B,)."""
    low, high = np.percentile(resampled, (_LOW, _HIGH))
    return Estimate(float(mean), float(low), float(high))


def bootstrap(
    samples: Sequence[Array],
    statistic: Callable[..., Array],
    seed: int,
    *,
    resamples: int = RESAMPLES,
    paired: bool = False,
    width: int | None = None,
) -> Array:
    """The values of a statistic in resamples, by `scipy.stats.bootstrap`.

    Args:
        samples: arrays (n,), each resampled by itself; of one length if paired.
        statistic: takes as many arrays (..., n) and ``axis=-1``, gives (...) or (K, ...).
        seed: seed of the resampling.
        resamples: how many, B.
        paired: whether a resample takes the same rows of all samples.
        width: numbers that the statistic holds at once for a resample; none: the longest sample.

    Returns:
        (B,) or (K, B) float64.
    """
    from scipy.stats import bootstrap as resample

    longest = max(map(len, samples))
    if longest == 1:  # scipy asks for two; of a single one every resample is the same
        return np.repeat(statistic(*samples, axis=-1)[..., None], resamples, -1)
    result = resample(
        samples,
        statistic,
        n_resamples=resamples,
        batch=max(1, _CHUNK // (width or longest)),
        vectorized=True,
        paired=paired,
        method="percentile",
        rng=seed,
    )
    return np.asarray(result.bootstrap_distribution)


def mean_interval(values: ArrayLike, seed: int) -> Estimate:
    """The mean over episodes, by a percentile bootstrap.

    Args:
        values: (n,) one value per episode, n >= 1.
        seed: seed of the resampling.

    Raises:
        ValueError: there are no values, or they are not (n,).
    """
    (sample,) = _samples(values)
    return percentile_interval(sample.mean(), bootstrap([sample], np.mean, seed))


def score_interval(
    method: ArrayLike, random: ArrayLike, best: ArrayLike, seed: int
) -> Estimate | None:
    """How far a method is from random play (0) to scripted dispatch (1).

    ``(mean(method) - mean(random)) / (mean(best) - mean(random))``; the three are paired:
    value e of each comes from the same world, and a resample takes the same worlds for all.

    Args:
        method: (n,) rescues by episode.
        random: (n,) rescues by episode of the random policy.
        best: (n,) rescues by episode of the best scripted policy.
        seed: seed of the resampling.

    Returns:
        The score; None where dispatch is not above random play in every resample, since the ratio
        then means nothing.

    Raises:
        ValueError: there are no values, or their numbers differ.
    """

    def parts(*samples: Array, axis: int) -> Array:
        m, r, h = (sample.mean(axis) for sample in samples)
        return np.stack([m - r, h - r])

    samples = _samples(method, random, best)
    above, span = parts(*samples, axis=-1)
    resampled = bootstrap(samples, parts, seed, paired=True)
    if span <= 0.0 or resampled[1].min() <= 0.0:
        return None
    return percentile_interval(above / span, resampled[0] / resampled[1])


def resampled_counts(n: int, seed: int, resamples: int = RESAMPLES) -> Array:
    """How often each of ``n`` episodes is drawn in each resample of a bootstrap.

    The mean of a resample is ``counts @ values / n``. One matrix serves any number of statistics
    of the same episodes and keeps them all paired, which `scipy.stats.bootstrap` cannot.

    Args:
        n: number of episodes.
        seed: seed of the resampling.
        resamples: how many, B.

    Returns:
        (B, n) float64 whole numbers; every row sums to n.
    """
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), resamples)
    return drawn.astype(np.float64)


def _samples(*values: ArrayLike) -> list[NDArray[Any]]:
    arrays = [np.asarray(value, np.float64) for value in values]
    shapes = {array.shape for array in arrays}
    if len(shapes) != 1 or arrays[0].ndim != 1 or not arrays[0].size:
        raise ValueError(f"values of shapes {sorted(shapes)}: must be (n,) for one n >= 1")
    return arrays
