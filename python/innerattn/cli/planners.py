"""What commands check of a planner's name and of its time."""

from __future__ import annotations

from innerattn.cli.options import UsageError
from innerattn.config.near import did_you_mean
from innerattn.policies.scripted.planner import LEARNT, PLANNERS

_MOST_MS = 86_400_000
_MOST_EVALUATIONS = 10**12


def check_planner(name: str, option: str) -> None:
    """Refuse what is no planner where ``option`` needs one.

    Args:
        name: what was asked for; some take a file, as in ``learnt:mine.safetensors``.
        option: that needs it.

    Raises:
        UsageError: it is none of `PLANNERS`, or has a file that it does not need.
    """
    kind, colon, file = name.partition(":")
    if colon and kind in LEARNT and not file:
        raise UsageError(f"{name}: needs a file after the colon, or no colon")
    if colon and kind in PLANNERS and kind not in LEARNT:
        raise UsageError(f"{name}: only {' and '.join(LEARNT)} take a file")
    if kind not in PLANNERS:
        near = did_you_mean(name, PLANNERS)
        raise UsageError(f"{name}: with {option} must be one of {', '.join(PLANNERS)}{near}")


def limit_ms(given: int | None) -> int:
    """How long to search for an instance [ms]; None: 1000.

    Raises:
        UsageError: it is out of range.
    """
    if given is not None and not 1 <= given <= _MOST_MS:
        raise UsageError(f"--time-limit-ms {given}: must be 1 to {_MOST_MS}")
    return 1000 if given is None else given


def check_evaluations(given: int | None) -> None:
    """Refuse a number of orders to try that is out of range.

    Raises:
        UsageError: it is.
    """
    if given is not None and not 1 <= given <= _MOST_EVALUATIONS:
        raise UsageError(f"--evaluations {given}: must be 1 to {_MOST_EVALUATIONS}")
