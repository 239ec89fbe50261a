"""Means with intervals; it knows nothing of what is averaged.

Rescues within an episode depend on each other, episodes do not, so whole episodes are what a
bootstrap resamples. Runs are too few for that; their interval is Student's.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from innerattn.stats.estimate import Estimate
from innerattn.stats.resampling import percentile_interval, resampled_means


def student_interval(values: ArrayLike) -> Estimate:
    """The mean over independent runs, by Student's t.

    ``mean ± t s / sqrt(n)``, with s the deviation of the sample and t the 97.5 % quantile of
    Student's distribution with n - 1 degrees of freedom.

    Args:
        values: (n,) one value per run, n >= 2.

    Raises:
        ValueError: there are fewer than two values.
    """
    column = _columns(values)[:, 0]
    n = len(column)
    if n < 2:
        raise ValueError(f"{n} value: an interval over runs needs at least 2")
    mean = float(column.mean())
    half = float(stdtrit(n - 1, 0.975) * column.std(ddof=1) / math.sqrt(n))
    return Estimate(mean, mean - half, mean + half)


def mean_interval(values: ArrayLike, seed: int) -> Estimate:
    """The mean over episodes, by a percentile bootstrap.

    Args:
        values: (n,) one value per episode, n >= 1.
        seed: seed of the resampling.

    Raises:
        ValueError: there are no values.
    """
    columns = _columns(values)
    means = resampled_means(columns, seed)[:, 0]
    return percentile_interval(columns[:, 0].mean(), means)


def score_interval(
    method: ArrayLike, random: ArrayLike, hungarian: ArrayLike, seed: int
) -> Estimate | None:
    """How far a method is from random play (0) to scripted dispatch (1).

    ``(mean(method) - mean(random)) / (mean(hungarian) - mean(random))``; the three are paired:
    value e of each comes from the same world, and a resample takes the same worlds for all.

    Args:
        method: (n,) rescues by episode.
        random: (n,) rescues by episode of the random policy.
        hungarian: (n,) rescues by episode of the hungarian policy.
        seed: seed of the resampling.

    Returns:
        The score; None where dispatch is not above random play in every resample, since the ratio
        then means nothing.

    Raises:
        ValueError: there are no values, or their numbers differ.
    """
    columns = _columns(method, random, hungarian)
    resampled = resampled_means(columns, seed)
    numerator = resampled[:, 0] - resampled[:, 1]
    denominator = resampled[:, 2] - resampled[:, 1]
    m, r, h = columns.mean(0)
    if h <= r or denominator.min() <= 0.0:
        return None
    return percentile_interval((m - r) / (h - r), numerator / denominator)


def _columns(*values: ArrayLike) -> NDArray[np.float64]:
    arrays = [np.asarray(value, np.float64) for value in values]
    shapes = {array.shape for array in arrays}
    if len(shapes) != 1 or arrays[0].ndim != 1 or not arrays[0].size:
        raise ValueError(f"values of shapes {sorted(shapes)}: must be (n,) for one n >= 1")
    return np.stack(arrays, 1)
