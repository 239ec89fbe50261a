"""How much of its rescues a policy keeps under faults, from counts alone; it runs nothing.

Retention is the ratio of rescues with a fault to rescues without, in the same worlds, from the
fault's onset on. All intervals come from one bootstrap over worlds, so that differences of two
policies that met the same worlds are paired.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.intervals import Interval, percentile_interval

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """Numbers and what a bootstrap makes of them.

    Attributes:
        value: (...) float64.
        resampled: (..., B) float64, the same of each resample.
    """

    value: Array
    resampled: Array

    def __getitem__(self, index: int | slice | tuple[int | slice, ...]) -> Estimate:
        """The same of a part, by an index into ``value``."""
        return Estimate(np.asarray(self.value[index]), np.asarray(self.resampled[index]))

    def __sub__(self, other: Estimate) -> Estimate:
        """The difference; paired, if both come from the same resampling."""
        return Estimate(self.value - other.value, self.resampled - other.resampled)

    def mean(self, axis: int | tuple[int, ...]) -> Estimate:
        """The mean along axes of ``value``, counted from the first."""
        return Estimate(self.value.mean(axis), self.resampled.mean(axis))

    def interval(self) -> Interval:
        """The value with its 95 % interval, of a single number.

        The ends are NaN where some resample has no value: then nothing limits it.
        """
        return percentile_interval(float(self.value), self.resampled)


def retention(faulty: Array, clean: Array, weights: Array) -> Estimate:
    """Rescues with a fault over rescues without.

    Args:
        faulty: (..., E) rescues by world with a fault.
        clean: (E,) rescues by world without, over the same steps.
        weights: (B, E) from `resampled_counts`.

    Returns:
        The ratios of means (...); NaN where nobody is rescued without faults.
    """
    below = clean.sum()
    below_resampled = weights @ clean
    above = np.asarray(faulty, np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.where(below > 0.0, above.sum(-1) / below, np.nan)
        ratio = (above @ weights.T) / below_resampled
    return Estimate(value, np.where(below_resampled > 0.0, ratio, np.nan))


def area(kept: Estimate, severities: Array, axis: int) -> Estimate:
    """Mean retention over severities from 0 to the last: the area under the curve by trapezoids.

    Args:
        kept: retention, with severities along ``axis``; at severity 0 it is 1.
        severities: (S,) rising, above 0.
        axis: of ``kept.value``, counted from the first.
    """
    x = np.concatenate([[0.0], severities])

    def under(values: Array) -> Array:
        values = np.moveaxis(values, axis, -1)
        curve = np.concatenate([np.ones((*values.shape[:-1], 1)), values], -1)
        return np.asarray(np.trapezoid(curve, x, axis=-1) / x[-1])

    return Estimate(under(kept.value), under(kept.resampled))
