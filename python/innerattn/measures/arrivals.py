"""What becomes of victims that arrive whatever becomes of others, from records."""

from __future__ import annotations

from innerattn.measures.measure import Measure
from innerattn.records.record import Record


def turned_away(record: Record) -> int | None:
    """Number of victims that arrived when all slots of their task were taken; they never appeared.

    Returns:
        None where victims come when others are gone.
    """
    return None if record.turned_away is None else int(record.turned_away.sum())


MEASURES = (
    Measure(
        name="turned_away",
        unit="victims",
        meaning="victims that arrived when all slots of their task were taken",
        of=turned_away,
        is_count=True,
        applies=lambda scenario: scenario.has_arrivals,
    ),
)
