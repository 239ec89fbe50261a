"""What commands check of a planner's name and of its time."""

from __future__ import annotations

from innerattn.cli.options import UsageError
from innerattn.config.near import did_you_mean
from innerattn.policies.scripted.planner import PLANNERS

_MOST_MS = 86_400_000


def check_planner(name: str, option: str) -> None:
    """Refuse what is no planner where ``option`` needs one.

    Raises:
        UsageError: it is none of `PLANNERS`.
    """
    if name not in PLANNERS:
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
