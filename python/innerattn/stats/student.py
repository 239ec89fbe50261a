"""Student's t over independent values, such as one number per run."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.stats.estimate import Estimate

Array = NDArray[np.float64]


def t_quantile(p: ArrayLike, dof: ArrayLike) -> Array:
    """The quantile at probability ``p`` of Student's t with ``dof`` degrees of freedom."""
    from scipy.special import stdtrit  # here, since scipy takes longer to import than this package

    return np.asarray(stdtrit(dof, p))


def t_cdf(t: ArrayLike, dof: ArrayLike) -> Array:
    """The probability of a value up to ``t`` by Student's t with ``dof`` degrees of freedom."""
    from scipy.special import stdtr

    return np.asarray(stdtr(dof, t))


def student_interval(values: ArrayLike, level: float = 0.95) -> Estimate:
    """The mean over independent runs and its interval by Student's t.

    ``mean ± t s / sqrt(n)``, with s the sample's standard deviation and t the two-sided quantile of
    ``level`` of Student's distribution with n - 1 degrees of freedom.

    Args:
        values: (n,) one value per run, n >= 2.
        level: of the interval, in (0, 1).

    Raises:
        ValueError: there are fewer than two values, or they are not (n,).
    """
    array = _checked(values)
    mean, n = float(array.mean()), len(array)
    half = float(t_quantile(0.5 + level / 2.0, n - 1) * array.std(ddof=1) / math.sqrt(n))
    return Estimate(mean, mean - half, mean + half)


def difference_p(values: ArrayLike) -> float:
    """Two-sided p-value of the t-test against a mean of 0.

    Args:
        values: (n,) one value per run, n >= 2, that are not all the same.

    Raises:
        ValueError: there are fewer than two values, or they are not (n,).
    """
    array = _checked(values)
    return float(2.0 * t_cdf(-abs(array.mean()) / _standard_error(array), len(array) - 1))


def equivalence_p(values: ArrayLike, low: float, high: float) -> float:
    """P-value of two one-sided t-tests (TOST) against a mean at or beyond an end of a range.

    It is below 5 % where the 90 % interval of the mean lies within (low, high); Schuirmann 1987,
    J. Pharmacokinet. Biopharm. 15, 657-680.

    Args:
        values: (n,) one value per run, n >= 2, that are not all the same.
        low: low end of the range in which means count as equivalent.
        high: high end.

    Returns:
        The larger of the two p-values, which is that of the nearer end.

    Raises:
        ValueError: there are fewer than two values, or they are not (n,).
    """
    array = _checked(values)
    nearer = min(array.mean() - low, high - array.mean())
    return float(t_cdf(-nearer / _standard_error(array), len(array) - 1))


def _standard_error(array: Array) -> float:
    return float(array.std(ddof=1) / math.sqrt(len(array)))


def _checked(values: ArrayLike) -> Array:
    array = np.asarray(values, np.float64)
    if array.ndim != 1 or len(array) < 2:
        raise ValueError(f"values of shape {array.shape}: must be (n,) of at least 2 runs")
    return array
