"""Values as cells of tables in a terminal."""

from __future__ import annotations

import math

from innerattn.stats import Estimate

NONE = "-"
"""What stands where there is no value."""


def plus_minus(estimate: Estimate | None) -> str:
    """A mean and half its interval, as far as they are there."""
    if estimate is None or math.isnan(estimate.mean):
        return NONE
    if not estimate.bounded:
        return number(estimate.mean) if estimate.runs == 1 else NONE
    return f"{estimate.mean:.2f} ± {(estimate.high - estimate.low) / 2:.2f}"


def mean_alone(estimate: Estimate | None) -> str:
    """A mean without its interval."""
    return NONE if estimate is None else number(estimate.mean)


def number(value: float | None) -> str:
    """A number with two decimals."""
    return NONE if value is None or math.isnan(value) else f"{value:.2f}"


def percent(value: float | None) -> str:
    """A share as a whole percentage."""
    return NONE if value is None else f"{value:.0%}"
