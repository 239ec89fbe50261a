"""Estimates and p-values as text, for tables and sentences."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.stats.estimate import Estimate

NONE = "–"
"""What stands where there is no value."""


def format_estimate(value: Estimate | None, decimals: int = 2) -> str:
    """A number with its interval in brackets, where it has one."""
    if value is None:
        return NONE
    mean = format_number(value.mean, decimals)
    if not value.bounded:
        return mean
    return f"{mean} [{format_number(value.low, decimals)}, {format_number(value.high, decimals)}]"


def format_number(value: float, decimals: int = 2) -> str:
    """A number with so many decimals, and never as minus zero."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def format_signed(value: float, decimals: int = 2) -> str:
    """A number with its sign, and never as minus zero."""
    return f"{round(value, decimals) + 0.0:+.{decimals}f}"


def format_p(value: float | None) -> str:
    """A p-value."""
    if value is None:
        return NONE
    return "< 0.001" if value < 0.001 else format_number(value, 3)


def format_seeds(seeds: Sequence[int]) -> str:
    """Seeds in their order; a whole range by its ends."""
    ordered = sorted(seeds)
    if len(ordered) > 2 and ordered[-1] - ordered[0] == len(ordered) - 1:
        return f"{ordered[0]} to {ordered[-1]}"
    return ", ".join(map(str, ordered))
