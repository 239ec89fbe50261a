"""Do methods differ, or are they alike? From one value per run of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
class Contrast:
    """A weighted sum of the means of several groups of runs; of two, their difference.

    Attributes:
        difference: the weighted sum, and its 95 % interval by Welch and Satterthwaite, which
            grants every group a variance of its own.
        dof: Satterthwaite's degrees of freedom; Welch's, of two groups.
        p: two-sided, of the t-test against 0.
        margin: differences smaller than this count as none.
        equivalence_p: the larger of the p-values of two one-sided tests against a difference of at
            least ``margin`` either way.
        equivalent: equivalence_p is below 5 %, which is that the 90 % interval lies within ±
            ``margin``.
        hedges_g: standardised difference, ``J difference / s`` with the pooled deviation s of all
            groups and J the correction for few runs (Hedges 1981), and the exact 95 % interval of
            the true one by the noncentral t; both take equal variances for granted.
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


def contrast(
    groups: Sequence[ArrayLike], weights: Sequence[float], margin: float
) -> Contrast | None:
    """Compare weighted means of groups of runs, such as a main effect of a crossed design.

    Args:
        groups: of each (n,) one value per run, n >= 2.
        weights: of each group; they sum to 0. With two groups, 1 and -1 compare the first with the
            second.
        margin: the largest difference that does not matter, above 0, in the values' unit.

    Returns:
        The comparison; None where the runs of no group that counts differ among themselves, which
        leaves nothing to judge a difference by.

    Raises:
        ValueError: a group has less than two values, the weights do not fit, or the margin is not
            above 0.
    """
    if len(groups) != len(weights) or not math.isclose(sum(weights), 0.0, abs_tol=1e-12):
        raise ValueError(f"weights = {list(weights)}: must be one of each group and sum to 0")
    if not (math.isfinite(margin) and margin > 0.0):
        raise ValueError(f"margin = {margin}: must be finite and above 0")
    known = [
        (_values(f"groups[{i}]", values), weight)
        for i, (values, weight) in enumerate(zip(groups, weights, strict=True))
    ]
    parts = [(values, weight) for values, weight in known if weight]
    if all(np.ptp(values) == 0.0 for values, _ in parts):
        return None
    difference = float(sum(weight * values.mean() for values, weight in parts))
    squares = [weight**2 * values.var(ddof=1) / len(values) for values, weight in parts]
    error = math.sqrt(sum(squares))
    spread = sum(
        square**2 / (len(values) - 1) for square, (values, _) in zip(squares, parts, strict=True)
    )
    dof = float(error**4 / spread)
    half = float(stdtrit(dof, 1.0 - ALPHA / 2.0)) * error
    equivalence_p = float(stdtr(dof, -(margin - abs(difference)) / error))
    return Contrast(
        difference=Interval(difference, difference - half, difference + half),
        dof=dof,
        p=float(2.0 * stdtr(dof, -abs(difference) / error)),
        margin=margin,
        equivalence_p=equivalence_p,
        equivalent=equivalence_p < ALPHA,
        hedges_g=_hedges_g(parts, difference),
    )


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
    found = contrast([ours, theirs], [1.0, -1.0], margin)
    if found is None:
        return None
    permutation_p = _permutation_p(np.concatenate([ours, theirs]), len(ours), seed)
    return Comparison(**vars(found), permutation_p=permutation_p)


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


def _hedges_g(parts: Sequence[tuple[NDArray[np.float64], float]], difference: float) -> Interval:
    dofs = [len(values) - 1 for values, _ in parts]
    dof = sum(dofs)
    within = sum(n * values.var(ddof=1) for n, (values, _) in zip(dofs, parts, strict=True))
    scale = math.sqrt(sum(weight**2 / len(values) for values, weight in parts))
    effect = difference / math.sqrt(within / dof)
    correction = math.exp(gammaln(dof / 2) - gammaln((dof - 1) / 2)) / math.sqrt(dof / 2)
    # Effect / scale is the t of the pooled test; its noncentrality is the true effect / scale.
    low, high = (
        float(nctdtrinc(dof, quantile, effect / scale)) * scale
        for quantile in (1.0 - ALPHA / 2.0, ALPHA / 2.0)
    )
    return Interval(correction * effect, low, high)


def _values(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values, np.float64)
    if array.ndim != 1 or len(array) < 2 or not np.isfinite(array).all():
        raise ValueError(f"{name} = {array.tolist()}: must be (2 or more,) finite numbers")
    return array
