"""Statistics over several runs that a few bad runs do not spoil, after Agarwal et al. 2021.

"Deep reinforcement learning at the edge of the statistical precipice", NeurIPS 34, §4. Runs are
grouped into strata (situations), and a bootstrap resamples runs within each. With few runs in each
stratum its percentile intervals are too short: prefer `student.student_interval` of the mean then.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.stats.bootstrap import bootstrap, percentile_interval
from innerattn.stats.estimate import Estimate

Array = NDArray[np.float64]

_RESAMPLES = 10_000


def interquartile_mean(values: ArrayLike) -> float:
    """The mean without the lowest and the highest quarter, each rounded down to whole values.

    Args:
        values: (n,) of all strata together, n >= 1.

    Raises:
        ValueError: there are no values, or they are not (n,).
    """
    return float(_trimmed_mean(_checked(values, 1), axis=-1))


def iqm_interval(strata: Sequence[ArrayLike], seed: int) -> Estimate:
    """The interquartile mean over all runs, by a percentile bootstrap within strata.

    Args:
        strata: S times (n,) one value per run, n >= 2, which may differ.
        seed: seed of the resampling.

    Raises:
        ValueError: there is no stratum, or one has fewer than two values.
    """
    groups = _checked_groups("strata", strata)
    resampled = bootstrap(
        groups, _trimmed_mean, seed, resamples=_RESAMPLES, width=sum(map(len, groups))
    )
    return percentile_interval(float(_trimmed_mean(*groups, axis=-1)), resampled)


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
        ValueError: there is no stratum, one has fewer than two values, or their numbers differ.
    """
    of_x, of_y = _checked_groups("x", x), _checked_groups("y", y)
    if len(of_x) != len(of_y):
        raise ValueError(f"x has {len(of_x)} strata, y {len(of_y)}: must be as many")

    def improvement(*groups: Array, axis: int) -> Array:
        assert axis == -1
        strata = zip(groups[: len(of_x)], groups[len(of_x) :], strict=True)
        wins = [np.sign(a[..., :, None] - b[..., None, :]).mean((-2, -1)) for a, b in strata]
        return np.asarray(0.5 * (np.mean(wins, 0) + 1.0))

    groups = [*of_x, *of_y]
    pairs = sum(len(a) * len(b) for a, b in zip(of_x, of_y, strict=True))
    resampled = bootstrap(groups, improvement, seed, resamples=_RESAMPLES, width=pairs)
    return percentile_interval(float(improvement(*groups, axis=-1)), resampled)


def _trimmed_mean(*groups: Array, axis: int) -> Array:
    """Interquartile means of all groups together, along the last axis."""
    from scipy.stats import trim_mean

    return np.asarray(trim_mean(np.concatenate(groups, axis), 0.25, axis))


def _checked_groups(name: str, strata: Sequence[ArrayLike]) -> list[Array]:
    if not len(strata):
        raise ValueError(f"{name}: there must be at least one stratum")
    return [_checked(values, 2) for values in strata]


def _checked(values: ArrayLike, least: int) -> Array:
    array = np.asarray(values, np.float64)
    if array.ndim != 1 or len(array) < least or not np.isfinite(array).all():
        raise ValueError(f"values {array.tolist()}: must be ({least} or more,) finite numbers")
    return array
