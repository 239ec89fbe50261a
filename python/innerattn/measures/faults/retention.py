"""How much of its rescues a policy keeps under faults, from counts alone; it runs nothing.

Retention is the ratio of rescues with a fault to rescues without, in the same worlds, from the
fault's onset on. All intervals come from one bootstrap over worlds, so that differences of two
policies that met the same worlds are paired.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.bootstrap import Resampled

Array = NDArray[np.float64]


def retention(faulty: Array, clean: Array, weights: Array) -> Resampled:
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
    return Resampled(value, np.where(below_resampled > 0.0, ratio, np.nan))


def area(kept: Resampled, severities: Array, axis: int) -> Resampled:
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

    return Resampled(under(kept.value), under(kept.resampled))
