"""What a measure is: a number that is a pure function of a record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from innerattn.config import Scenario
from innerattn.records.record import FIELDS, Record
from innerattn.stats.estimate import Estimate

Value = Estimate | float | int | None
"""What a measure gives; None where the record does not determine it."""


@dataclass(frozen=True)
class Measure:
    """A number about how a team did.

    Attributes:
        name: the key under which it is stored, such as ``time_to_rescue_s``; a time ends in ``_s``.
        unit: as a table's heading shows it; empty if the name says it.
        meaning: what it is, in one line.
        of: computes it from a record; it plays nothing and keeps no state.
        needs: those of `innerattn.records.FIELDS` that must have been recorded step by step.
        is_count: it counts the events that other measures are over, so that its mean over runs
            says nothing.
        applies: whether it can be said of a scenario; of others it is left out.

    Raises:
        ValueError: the name is no identifier, or a field that it needs cannot be recorded.
    """

    name: str
    unit: str
    meaning: str
    of: Callable[[Record], Value]
    needs: tuple[str, ...] = ()
    is_count: bool = False
    applies: Callable[[Scenario], bool] = lambda _: True

    def __post_init__(self) -> None:
        """Refuse what could not be stored or recorded."""
        if not self.name.isidentifier():
            raise ValueError(f"measure {self.name!r}: name must be an identifier")
        unknown = [name for name in self.needs if name not in FIELDS]
        if unknown:
            raise ValueError(
                f"measure {self.name!r}: needs {', '.join(unknown)}; can be recorded: "
                f"{', '.join(FIELDS)}"
            )
