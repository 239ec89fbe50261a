"""Figures over runs of which there may be few: a mean, and an interval where it can be had."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.estimate import Estimate
from innerattn.stats.student import student_interval, t_quantile

Array = NDArray[np.float64]

BandKind = Literal["student", "range", "none"]
"""student: 95 % interval of the mean by Student's t over runs, from three runs on; range: least and
largest of two runs, whose interval would say nothing; none: a single run."""

BAND_NAMES: dict[BandKind, str] = {
    "student": "95 %",
    "range": "least to largest",
    "none": "no band",
}
"""How a band is named in a legend."""


@dataclass(frozen=True)
class SeedCurve:
    """A mean course over runs and what it lies between, by `BandKind`.

    Attributes:
        kind: what low and high are, where all runs have a value.
        mean: (...) float64 of the runs that have a value; NaN where none has.
        low: (...) float64; NaN where there is none.
        high: (...) float64.
        runs: (...) int64 how many have a value.
    """

    kind: BandKind
    mean: Array
    low: Array
    high: Array
    runs: NDArray[np.int64]

    def to_json(self) -> dict[str, Any]:
        """As a JSON object; what is not there is null."""
        shown = {name: numbers(getattr(self, name)) for name in ("mean", "low", "high")}
        return {"band": self.kind, **shown, "runs": self.runs.tolist()}


def seed_estimate(values: Sequence[float | None]) -> Estimate | None:
    """The mean over runs; None where no run has the figure."""
    found = [value for value in values if value is not None and math.isfinite(value)]
    if not found:
        return None
    if len(found) == 1:
        return Estimate(found[0], runs=1)
    interval = student_interval(found)
    return replace(interval, runs=len(found))


def seed_curve(values: Array) -> SeedCurve:
    """The course of a figure over runs.

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


def numbers(values: Array) -> Any:
    """Nested lists of numbers for JSON, None for NaN."""
    shown = values.astype(object)
    shown[~np.isfinite(values)] = None
    return shown.tolist()
