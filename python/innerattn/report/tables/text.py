"""Values as cells of tables in a terminal."""

from __future__ import annotations

import math

from innerattn.stats.intervals import Interval
from innerattn.stats.seeds import SeedEstimate

NONE = "-"
"""What stands where there is no value."""


def plus_minus(estimate: Interval | SeedEstimate | None) -> str:
    """A mean and half its interval, as far as they are there."""
    if estimate is None or math.isnan(estimate.mean):
        return NONE
    if estimate.low is None or estimate.high is None:
        return f"{estimate.mean:.2f}"
    if math.isnan(estimate.low):
        return NONE
    return f"{estimate.mean:.2f} ± {(estimate.high - estimate.low) / 2:.2f}"


def mean_alone(estimate: Interval | SeedEstimate | None) -> str:
    """A mean without its interval."""
    return NONE if estimate is None else number(estimate.mean)


def number(value: float | None) -> str:
    """A number with two decimals."""
    return NONE if value is None or math.isnan(value) else f"{value:.2f}"


def percent(value: float | None) -> str:
    """A share as a whole percentage."""
    return NONE if value is None else f"{value:.0%}"
