"""Do methods differ, or are they alike? From one value per run of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri, gammaln, nctdtrinc, stdtr, stdtrit

from innerattn.evaluate.statistics import Interval

ALPHA = 0.05
"""Level of every test."""

_ROUNDING = 1e-12  # values that are as near to each other, relatively, are the same
_LARGE_T = 1e3  # from here on the chi alone gives four digits, more than `nctdtrinc` does
_EXACT = 20_000  # up to so many ways to divide the runs, all are looked at
_SHUFFLES = 9_999


@dataclass(frozen=True)
class Contrast:
    """A difference of two methods, or another weighted sum of the means of several.

    Attributes:
        difference: it and its 95 % interval, by the t distribution.
        dof: degrees of freedom of that.
        p: two-sided, of the t-test against 0.
        margin: differences smaller than this count as none.
        equivalence_p: the larger of the p-values of two one-sided tests against a difference of at
            least ``margin`` either way.
        equivalent: equivalence_p is below 5 %, which is that the 90 % interval lies within ±
            ``margin``.
        hedges_g: standardised difference, ``J difference / s`` with a deviation s and J the
            correction for few runs (Hedges 1981), and the exact 95 % interval of the true one by
            the noncentral t.
    """

    difference: Interval
    dof: float
    p: float
    margin: float
    equivalence_p: float
    equivalent: bool
    hedges_g: Interval

    def to_json(self) -> dict[str, Any]:
        """As a JSON object, intervals as mean, low and high."""
        return asdict(self)


@dataclass(frozen=True)
class Comparison(Contrast):
    """Runs of method X against runs of method Y; the difference is X - Y.

    Attributes:
        permutation_p: two-sided, of |t| of Welch among all ways to divide the runs in two (Janssen
            1997), or among 9,999 random ones and the one seen. Of few runs there are few ways: of
            three and three it cannot be below 2 in 20.
    """

    permutation_p: float


def contrast(values: ArrayLike, weights: Sequence[float], margin: float) -> Contrast | None:
    """Compare methods that were run with the same seeds, such as the arms of a crossed design.

    The seed is the unit: each gives one weighted sum, and Student's t looks at these. Runs of one
    seed may therefore be as alike as they like, whatever the method.

    Args:
        values: (n, k), a row for each seed, n >= 3, with the value of each method's run.
        weights: (k,) of the methods; they sum to 0.
        margin: the largest difference that does not matter, above 0, in the values' unit.

    Returns:
        The comparison, ``hedges_g`` by the deviation of the weighted sum between seeds; None where
        that is the same for all, which leaves nothing to judge it by.

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
    n, deviation = len(sums), float(sums.std(ddof=1))
    difference = float(sums.mean())
    return Contrast(
        **_judged(difference, deviation / math.sqrt(n), n - 1.0, margin),
        hedges_g=_hedges_g(difference / deviation, math.sqrt(1 / n), n - 1),
    )


def compare(x: ArrayLike, y: ArrayLike, margin: float, seed: int) -> Comparison | None:
    """Compare two methods, whatever the seeds of their runs; by Welch and Satterthwaite.

    Args:
        x: (n,) one value per run, n >= 2.
        y: (m,) the same of the other method, m >= 2.
        margin: the largest difference that does not matter, above 0, in the values' unit.
        seed: seed of random divisions, where there are too many for all.

    Returns:
        The comparison, ``hedges_g`` by the pooled deviation of both, which takes equal variances
        for granted; None where the runs of neither method differ among themselves, which leaves
        nothing to judge a difference by.

    Raises:
        ValueError: there are less than two values, or the margin is not above 0.
    """
    _check_margin(margin)
    ours, theirs = _values("x", x), _values("y", y)
    groups = (ours, theirs)
    if all(np.ptp(values) <= _ROUNDING * np.abs(values).max() for values in groups):
        return None
    difference = float(ours.mean() - theirs.mean())
    squares = [float(values.var(ddof=1)) / len(values) for values in groups]
    error = math.sqrt(sum(squares))
    spread = sum(
        square**2 / (len(values) - 1) for square, values in zip(squares, groups, strict=True)
    )
    pooled_dof = len(ours) + len(theirs) - 2
    within = sum((len(values) - 1) * float(values.var(ddof=1)) for values in groups)
    effect = difference / math.sqrt(within / pooled_dof)
    scale = math.sqrt(1 / len(ours) + 1 / len(theirs))
    return Comparison(
        **_judged(difference, error, error**4 / spread, margin),
        hedges_g=_hedges_g(effect, scale, pooled_dof),
        permutation_p=_permutation_p(np.concatenate(groups), len(ours), seed),
    )


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values adjusted for being asked together, in their order (Holm 1979).

    The chance that one of them is below 5 % while there is nothing to find is then at most 5 %,
    however they depend on each other.
    """
    adjusted = [1.0] * len(p_values)
    largest = 0.0
    for rank, i in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[i]))
        adjusted[i] = largest
    return adjusted


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


def _judged(difference: float, error: float, dof: float, margin: float) -> dict[str, Any]:
    """What t-tests say of a difference, as fields of `Contrast`."""
    half = float(stdtrit(dof, 1.0 - ALPHA / 2.0)) * error
    equivalence_p = float(stdtr(dof, -(margin - abs(difference)) / error))
    return {
        "difference": Interval(difference, difference - half, difference + half),
        "dof": dof,
        "p": float(2.0 * stdtr(dof, -abs(difference) / error)),
        "margin": margin,
        "equivalence_p": equivalence_p,
        "equivalent": equivalence_p < ALPHA,
    }


def _hedges_g(effect: float, scale: float, dof: int) -> Interval:
    """The corrected standardised difference; ``effect / scale`` is the t of ``dof`` degrees."""
    correction = math.exp(gammaln(dof / 2) - gammaln((dof - 1) / 2)) / math.sqrt(dof / 2)
    t, quantiles = effect / scale, (1.0 - ALPHA / 2.0, ALPHA / 2.0)
    # The noncentrality of that t is the true effect / scale.
    if abs(t) < _LARGE_T:
        ends = [float(nctdtrinc(dof, quantile, t)) * scale for quantile in quantiles]
    else:
        ends = [effect * math.sqrt(chdtri(dof, quantile) / dof) for quantile in quantiles]
    return Interval(correction * effect, min(ends), max(ends))


def _check_margin(margin: float) -> None:
    if not (math.isfinite(margin) and margin > 0.0):
        raise ValueError(f"margin = {margin}: must be finite and above 0")


def _values(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values, np.float64)
    if array.ndim != 1 or len(array) < 2 or not np.isfinite(array).all():
        raise ValueError(f"{name} = {array.tolist()}: must be (2 or more,) finite numbers")
    return array
