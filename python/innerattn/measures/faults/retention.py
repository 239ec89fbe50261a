"""Rescues under faults, and the share that a policy retains, from counts alone; it plays nothing.

Retention is the ratio of rescues with a fault to rescues without, in the same worlds, from the
fault's onset on. It flatters a policy that rescues few anyway, so rescues stand beside it. All
intervals come from one bootstrap over worlds, so that differences of two policies that met the same
worlds are paired.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.stats.bootstrap import Resampled

Array = NDArray[np.float64]

_ONE = Resampled(np.ones(()), np.ones(1))


def mean_rescues(counts: Array, weights: Array) -> Resampled:
    """Mean rescues of a world.

    Args:
        counts: (..., E) rescues by world.
        weights: (B, E) from `resampled_counts`.

    Returns:
        The means (...).
    """
    rescues = np.asarray(counts, np.float64)
    return Resampled(np.asarray(rescues.mean(-1)), rescues @ weights.T / rescues.shape[-1])


def retention(faulty: Array, clean: Array, weights: Array) -> Resampled:
    """Rescues with a fault divided by rescues without.

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


def area(values: Resampled, severities: Array, axis: int, intact: Resampled = _ONE) -> Resampled:
    """The mean over severities from 0 to the last: the area under the curve by trapezoids.

    Args:
        values: retention or rescues, with severities along ``axis``.
        severities: (S,) rising, above 0.
        axis: of ``values.value``, counted from the first.
        intact: the single value at severity 0; that of retention is 1.
    """
    x = np.concatenate([[0.0], severities])

    def under(curves: Array, start: Array) -> Array:
        curves = np.moveaxis(curves, axis, -1)
        first = np.broadcast_to(start, curves.shape[:-1])[..., None]
        return np.asarray(np.trapezoid(np.concatenate([first, curves], -1), x, axis=-1) / x[-1])

    return Resampled(under(values.value, intact.value), under(values.resampled, intact.resampled))
