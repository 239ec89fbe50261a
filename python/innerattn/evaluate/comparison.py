"""Do two methods differ, or are they alike? From one value per run of each."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaln, nctdtrinc, stdtr, stdtrit

from innerattn.evaluate.statistics import Interval

ALPHA = 0.05
"""Level of every test."""

_EXACT = 20_000  # up to so many ways to divide the runs, all are looked at
_SHUFFLES = 9_999


@dataclass(frozen=True)
class Comparison:
    """Runs of method X against runs of method Y.

    Attributes:
        difference: of the means, X - Y, and Welch's 95 % interval.
        dof: Welch's degrees of freedom.
        p: two-sided, of Welch's t-test.
        permutation_p: two-sided, of |t| of Welch among all ways to divide the runs in two (Janssen
            1997), or among 9,999 random ones and the one seen. Of few runs there are few ways: of
            three and three it cannot be below 2 in 20.
        margin: differences smaller than this count as none.
        equivalence_p: the larger of the p-values of Welch's two one-sided tests against a
            difference of at least ``margin`` either way.
        equivalent: equivalence_p is below 5 %, which is that the 90 % interval lies within ±
            ``margin``.
        hedges_g: standardised difference, ``J (mean X - mean Y) / s`` with the pooled deviation s
            and J the correction for few runs (Hedges 1981), and the exact 95 % interval of the
            true one by the noncentral t; both take equal variances for granted.
    """

    difference: Interval
    dof: float
    p: float
    permutation_p: float
    margin: float
    equivalence_p: float
    equivalent: bool
    hedges_g: Interval

    def to_json(self) -> dict[str, Any]:
        """As a JSON object, intervals as mean, low and high."""
        return asdict(self)


def compare(x: ArrayLike, y: ArrayLike, margin: float, seed: int) -> Comparison | None:
    """Compare two methods.

    Args:
        x: (n,) one value per run, n >= 2.
        y: (m,) the same of the other method, m >= 2.
        margin: the largest difference that does not matter, above 0, in the values' unit.
        seed: seed of random divisions, where there are too many for all.

    Returns:
        The comparison; None where the runs of neither method differ among themselves, which leaves
        nothing to judge a difference by.

    Raises:
        ValueError: there are less than two values, or the margin is not above 0.
    """
    ours, theirs = _values("x", x), _values("y", y)
    if not (math.isfinite(margin) and margin > 0.0):
        raise ValueError(f"margin = {margin}: must be finite and above 0")
    if np.ptp(ours) == 0.0 and np.ptp(theirs) == 0.0:
        return None
    difference = float(ours.mean() - theirs.mean())
    of_x, of_y = (values.var(ddof=1) / len(values) for values in (ours, theirs))
    error = math.sqrt(of_x + of_y)
    dof = float(error**4 / (of_x**2 / (len(ours) - 1) + of_y**2 / (len(theirs) - 1)))
    half = float(stdtrit(dof, 1.0 - ALPHA / 2.0)) * error
    equivalence_p = float(stdtr(dof, -(margin - abs(difference)) / error))
    return Comparison(
        difference=Interval(difference, difference - half, difference + half),
        dof=dof,
        p=float(2.0 * stdtr(dof, -abs(difference) / error)),
        permutation_p=_permutation_p(np.concatenate([ours, theirs]), len(ours), seed),
        margin=margin,
        equivalence_p=equivalence_p,
        equivalent=equivalence_p < ALPHA,
        hedges_g=_hedges_g(ours, theirs),
    )


def _permutation_p(values: NDArray[np.float64], n: int, seed: int) -> float:
    """Share of divisions into n and the rest whose |t| is no less than that of the first n."""
    ways = math.comb(len(values), n)
    seen = np.arange(n)[None]
    if ways <= _EXACT:
        chosen = np.array(list(combinations(range(len(values)), n)))
        extra = 0
    else:
        rows = np.tile(np.arange(len(values)), (_SHUFFLES, 1))
        chosen = np.random.default_rng(seed).permuted(rows, axis=1)[:, :n]
        extra = 1  # the division seen is one of them, so that p is never 0
    least = _welch_t(values, seen)[0] * (1.0 - 1e-9)  # equal ones may differ by rounding
    larger = int((_welch_t(values, chosen) >= least).sum())
    return (larger + extra) / (len(chosen) + extra)


def _welch_t(values: NDArray[np.float64], chosen: NDArray[np.int64]) -> NDArray[np.float64]:
    """|t| of each division, (B,); ``chosen`` (B, n) are the indices of its first group."""
    first = np.zeros((len(chosen), len(values)), bool)
    np.put_along_axis(first, chosen, True, 1)
    n = chosen.shape[1]
    x = values[chosen]
    y = np.broadcast_to(values, first.shape)[~first].reshape(len(chosen), -1)
    apart = np.abs(x.mean(1) - y.mean(1))
    error = np.sqrt(x.var(1, ddof=1) / n + y.var(1, ddof=1) / y.shape[1])
    return np.where(error > 0.0, apart / np.where(error > 0.0, error, 1.0), np.inf)


def _hedges_g(x: NDArray[np.float64], y: NDArray[np.float64]) -> Interval:
    dof = len(x) + len(y) - 2
    pooled = math.sqrt(((len(x) - 1) * x.var(ddof=1) + (len(y) - 1) * y.var(ddof=1)) / dof)
    scale = math.sqrt(len(x) * len(y) / (len(x) + len(y)))  # from the true g to noncentrality
    effect = float(x.mean() - y.mean()) / pooled
    correction = math.exp(gammaln(dof / 2) - gammaln((dof - 1) / 2)) / math.sqrt(dof / 2)
    low, high = (
        float(nctdtrinc(dof, quantile, effect * scale)) / scale
        for quantile in (1.0 - ALPHA / 2.0, ALPHA / 2.0)
    )
    return Interval(correction * effect, low, high)


def _values(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values, np.float64)
    if array.ndim != 1 or len(array) < 2 or not np.isfinite(array).all():
        raise ValueError(f"{name} = {array.tolist()}: must be (2 or more,) finite numbers")
    return array
