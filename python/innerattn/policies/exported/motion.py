"""How fast a robot becomes, by the law of motion of the worlds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ENOUGH_PERIODS = 200  # by then a robot drives at its final speed, or the lag no longer matters


def final_speed_and_lag(kept: Array, push: Array, limit: Array, dt_s: float) -> tuple[Array, Array]:
    """Final speeds at full drive [m/s], and the time that a start from rest costs against them [s].

    Each period begins with v <- min(kept v + push, limit).

    Args:
        kept: (R,) share of its speed that a robot keeps.
        push: (..., R) what a period of full drive adds to it [m/s].
        limit: (..., R) the highest speed [m/s].
        dt_s: a control period [s].

    Returns:
        Two arrays (..., R) float64.
    """
    speeds = np.zeros((_ENOUGH_PERIODS, *np.shape(push)))
    for period in range(1, _ENOUGH_PERIODS + 1):
        before = speeds[period - 2] if period > 1 else 0.0
        speeds[period - 1] = np.minimum(kept * before + push, limit)
    final = speeds[-1]
    shortfall = 1.0 - speeds / np.maximum(final, 1e-12)
    return final, np.where(final > 0.0, shortfall.sum(0) * dt_s, 0.0)
