"""Figures over several runs that a few bad runs do not spoil, after Agarwal et al. 2021.

"Deep reinforcement learning at the edge of the statistical precipice", NeurIPS 34, §4. Runs are
grouped into strata (situations), and a bootstrap resamples runs within each. Its percentile
intervals are too short where strata hold few runs; Student's interval of the mean
(`statistics.student_interval`) is the one to trust then.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.stats.estimate import Estimate
from innerattn.stats.resampling import percentile_interval

Array = NDArray[np.float64]

_RESAMPLES = 10_000


def interquartile_mean(values: ArrayLike) -> float:
    """The mean without the lowest and the highest quarter, each rounded down to whole values.

    Args:
        values: (n,) of all strata together, n >= 1.

    Raises:
        ValueError: there are no values, or they are not (n,).
    """
    return float(_trimmed(_values(values, 1)[None])[0])


def iqm_interval(strata: Sequence[ArrayLike], seed: int) -> Estimate:
    """The interquartile mean over all runs, by a percentile bootstrap within strata.

    Args:
        strata: S times (n,) one value per run, n >= 2, which may differ.
        seed: seed of the resampling.

    Raises:
        ValueError: there is no stratum, or one has less than two values.
    """
    groups = _groups("strata", strata)
    rng = np.random.default_rng(seed)
    rows = (rng.integers(0, len(values), (_RESAMPLES, len(values))) for values in groups)
    resampled = [values[drawn] for values, drawn in zip(groups, rows, strict=True)]
    mean = interquartile_mean(np.concatenate(groups))
    return percentile_interval(mean, _trimmed(np.concatenate(resampled, 1)))


def improvement_interval(x: Sequence[ArrayLike], y: Sequence[ArrayLike], seed: int) -> Estimate:
    """How probably a run of method X is better than one of method Y, ``P(X > Y) + P(X = Y) / 2``.

    It is the mean over strata of the share of pairs of runs (Mann and Whitney's U / n m), by a
    percentile bootstrap of the runs of both methods within strata. Where every run of one method
    beats every run of the other the interval has no length, however few they are.

    Args:
        x: S times (n,) one value per run, n >= 2; more is better.
        y: S times (m,) the same of the other method, in the same strata.
        seed: seed of the resampling.

    Raises:
        ValueError: there is no stratum, one has less than two values, or their numbers differ.
    """
    better, worse = _groups("x", x), _groups("y", y)
    if len(better) != len(worse):
        raise ValueError(f"x has {len(better)} strata, y {len(worse)}: must be as many")
    rng = np.random.default_rng(seed)
    means, resampled = [], []
    for ours, theirs in zip(better, worse, strict=True):
        wins = 0.5 * (np.sign(ours[:, None] - theirs) + 1.0)
        of_x, of_y = (
            rng.multinomial(n, np.full(n, 1.0 / n), _RESAMPLES) / n for n in wins.shape
        )  # how often each run is drawn
        means.append(wins.mean())
        resampled.append(((of_x @ wins) * of_y).sum(1))
    return percentile_interval(float(np.mean(means)), np.mean(resampled, 0))


def _trimmed(values: Array) -> Array:
    """Interquartile means of the rows of (B, n)."""
    n = values.shape[1]
    return np.asarray(np.sort(values, 1)[:, n // 4 : n - n // 4].mean(1))


def _groups(name: str, strata: Sequence[ArrayLike]) -> list[Array]:
    if not len(strata):
        raise ValueError(f"{name}: there must be at least one stratum")
    return [_values(values, 2) for values in strata]


def _values(values: ArrayLike, least: int) -> Array:
    array = np.asarray(values, np.float64)
    if array.ndim != 1 or len(array) < least or not np.isfinite(array).all():
        raise ValueError(f"values {array.tolist()}: must be ({least} or more,) finite numbers")
    return array
