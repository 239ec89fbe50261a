"""Differences and equivalence of methods, from runs of each with the same seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from innerattn.stats.estimate import Estimate
from innerattn.stats.student import difference_p, equivalence_p, student_interval

ALPHA = 0.05
"""Level of every test."""

_ROUNDING = 1e-12  # values that are as near to each other, relatively, are the same
_LARGE_T = 1e3  # from here on the chi alone gives four digits, more than `nctdtrinc` does


@dataclass(frozen=True)
class Contrast:
    """A difference of two methods, or another weighted sum of the means of several.

    Attributes:
        difference: with its 95 % interval, by Student's t.
        dof: degrees of freedom of the t distribution.
        p: two-sided, of the t-test against 0.
        margin: smaller differences than this count as none.
        equivalence_p: of two one-sided tests against a difference of at least ``margin``.
        equivalent: equivalence_p is below 5 %, so that the 90 % interval lies within ± ``margin``.
        hedges_g: standardised difference, ``J difference / s`` with a standard deviation s and J
            the correction for few runs (Hedges 1981), and the exact 95 % interval of the true one
            by the noncentral t.
    """

    difference: Estimate
    dof: float
    p: float
    margin: float
    equivalence_p: float
    equivalent: bool
    hedges_g: Estimate


def contrast(values: ArrayLike, weights: Sequence[float], margin: float) -> Contrast | None:
    """Compare methods that were run with the same seeds, such as the arms of a crossed design.

    The seed is the unit: each gives one weighted sum, and the t-test is over these sums. Runs of
    one seed may therefore depend on each other.

    Args:
        values: (n, k), a row for each seed, n >= 3, with the value of each method's run.
        weights: (k,) of the methods; they sum to 0.
        margin: the largest difference that does not matter, above 0, in the values' unit.

    Returns:
        The comparison; ``hedges_g`` is by the standard deviation of the weighted sums. None where
        all seeds give the same sum, which leaves no variance to judge it by.

    Raises:
        ValueError: there are less than three seeds, the weights do not fit, or the margin is not
            above 0.
    """
    _check_margin(margin)
    rows, parts = np.asarray(values, np.float64), np.asarray(weights, np.float64)
    if rows.ndim != 2 or len(rows) < 3 or not np.isfinite(rows).all():
        raise ValueError(f"values = {rows.tolist()}: must be (3 or more, k) finite numbers")
    if parts.shape != rows.shape[1:] or not math.isclose(parts.sum(), 0.0, abs_tol=1e-12):
        raise ValueError(f"weights = {parts.tolist()}: must be one of each method and sum to 0")
    sums = rows @ parts
    if np.ptp(sums) <= _ROUNDING * (np.abs(rows) @ np.abs(parts)).max():
        return None
    n, p = len(sums), equivalence_p(sums, -margin, margin)
    return Contrast(
        difference=student_interval(sums),
        dof=n - 1.0,
        p=difference_p(sums),
        margin=margin,
        equivalence_p=p,
        equivalent=p < ALPHA,
        hedges_g=_hedges_g(float(sums.mean() / sums.std(ddof=1)), math.sqrt(1 / n), n - 1),
    )


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values adjusted for multiple testing, in their order (Holm 1979).

    The chance that any of them falls below 5 % without a true effect is then at most 5 %, however
    the tests depend on each other.
    """
    adjusted = [1.0] * len(p_values)
    largest = 0.0
    for rank, i in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[i]))
        adjusted[i] = largest
    return adjusted


def _hedges_g(effect: float, scale: float, dof: int) -> Estimate:
    """The corrected standardised difference; ``effect / scale`` is the t of ``dof`` degrees."""
    from scipy.special import chdtri, gammaln, nctdtrinc

    correction = math.exp(gammaln(dof / 2) - gammaln((dof - 1) / 2)) / math.sqrt(dof / 2)
    t, quantiles = effect / scale, (1.0 - ALPHA / 2.0, ALPHA / 2.0)
    # The noncentrality of that t is the true effect / scale.
    if abs(t) < _LARGE_T:
        ends = [float(nctdtrinc(dof, quantile, t)) * scale for quantile in quantiles]
    else:
        ends = [effect * math.sqrt(chdtri(dof, quantile) / dof) for quantile in quantiles]
    return Estimate(correction * effect, min(ends), max(ends))


def _check_margin(margin: float) -> None:
    if not (math.isfinite(margin) and margin > 0.0):
        raise ValueError(f"margin = {margin}: must be finite and above 0")
