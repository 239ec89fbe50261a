"""Estimates as they are written in tables and sentences."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.stats.estimate import Estimate

NONE = "–"
"""What stands where there is no value."""


def shown(value: Estimate | None, decimals: int = 2) -> str:
    """A mean with its interval, where it has one."""
    if value is None:
        return NONE
    mean = fixed(value.mean, decimals)
    if not value.bounded:
        return mean
    return f"{mean} [{fixed(value.low, decimals)}, {fixed(value.high, decimals)}]"


def fixed(value: float, decimals: int = 2) -> str:
    """A number with so many decimals; none is minus zero."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def signed(value: float, decimals: int = 2) -> str:
    """A number with its sign; none is minus zero."""
    return f"{round(value, decimals) + 0.0:+.{decimals}f}"


def p_shown(value: float | None) -> str:
    """A p-value."""
    if value is None:
        return NONE
    return "< 0.001" if value < 0.001 else fixed(value, 3)


def seeds_shown(seeds: Sequence[int]) -> str:
    """Seeds in their order; a whole range by its ends."""
    ordered = sorted(seeds)
    if len(ordered) > 2 and ordered[-1] - ordered[0] == len(ordered) - 1:
        return f"{ordered[0]} to {ordered[-1]}"
    return ", ".join(map(str, ordered))
