"""Means over runs, of which there may be few, with an interval where there are enough."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.estimate import Estimate
from innerattn.stats.student import student_interval, t_quantile

Array = NDArray[np.float64]

BandKind = Literal["student", "range", "none"]
"""student: 95 % interval of the mean by Student's t, for three runs or more; range: smallest and
largest of two runs, whose t interval would be too wide to tell anything; none: a single run."""

BAND_NAMES: dict[BandKind, str] = {
    "student": "95 %",
    "range": "least to largest",
    "none": "no band",
}
"""How a band is named in a legend."""


@dataclass(frozen=True)
class SeedCurve:
    """A mean curve over runs and its band.

    Attributes:
        band: what low and high are, where all runs have a value.
        mean: (...) float64 of the runs that have a value; NaN where none has.
        low: (...) float64 low end of the band; NaN where there is none.
        high: (...) float64 high end.
        runs: (...) int64 how many have a value.
    """

    band: BandKind
    mean: Array
    low: Array
    high: Array
    runs: NDArray[np.int64]


def seed_estimate(values: Sequence[float | None]) -> Estimate | None:
    """The mean over runs and Student's 95 % interval, unbounded for a single run.

    Args:
        values: by run; None or not finite where a run has none.

    Returns:
        None where no run has a value.
    """
    known = [value for value in values if value is not None and math.isfinite(value)]
    if len(known) < 2:
        return Estimate(known[0], runs=1) if known else None
    return replace(student_interval(known), runs=len(known))


def seed_curve(values: Array) -> SeedCurve:
    """The mean curve over runs.

    Args:
        values: (N, ...) by run; NaN where a run has no value.
    """
    has = np.isfinite(values)
    n = has.sum(0)
    mean = np.where(n > 0, np.where(has, values, 0.0).sum(0) / np.maximum(n, 1), np.nan)
    least = np.where(has, values, np.inf).min(0)
    most = np.where(has, values, -np.inf).max(0)
    squares = (np.where(has, values - mean, 0.0) ** 2).sum(0)
    dof = np.maximum(n - 1, 1)
    half = t_quantile(0.975, dof) * np.sqrt(squares / dof / np.maximum(n, 1))
    low = np.where(n > 2, mean - half, np.where(n == 2, least, np.nan))
    high = np.where(n > 2, mean + half, np.where(n == 2, most, np.nan))
    kinds: tuple[BandKind, ...] = ("none", "range", "student")
    return SeedCurve(kinds[min(len(values), 3) - 1], mean, low, high, n)
