"""Which victims are rescued before their deadline, from records."""

from __future__ import annotations

import numpy as np

from innerattn.measures.measure import Measure
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval


def lost(record: Record) -> int:
    """Number of victims that were lost."""
    return len(record.lost)


def in_time(record: Record) -> Estimate | None:
    """Share of victims that were rescued before their deadline, of all that were rescued or lost.

    Victims that still waited when their episode ended do not count. The interval is over episodes.

    Returns:
        None where less than two episodes have such victims.
    """
    rescued = record.rescue_counts()
    episode = record.lost["episode"] - record.first_episode
    settled = rescued + np.bincount(episode, minlength=record.num_episodes)
    return ratio_interval(rescued.astype(np.float64), settled)


MEASURES = (
    Measure(
        name="lost",
        unit="victims",
        meaning="victims that were lost, as their deadline passed",
        of=lost,
        is_count=True,
        applies=lambda scenario: scenario.has_deadlines,
    ),
    Measure(
        name="in_time",
        unit="",
        meaning="share of victims rescued before their deadline, of those rescued or lost",
        of=in_time,
        applies=lambda scenario: scenario.has_deadlines,
    ),
)
