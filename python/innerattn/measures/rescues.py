"""How many victims a team rescues."""

from __future__ import annotations

from innerattn.measures.measure import Measure
from innerattn.records.record import Record
from innerattn.stats.bootstrap import mean_interval
from innerattn.stats.estimate import Estimate


def rescues_per_episode(record: Record) -> Estimate:
    """Mean number of rescues, by a bootstrap over episodes with the seed of the worlds."""
    return mean_interval(record.rescue_counts(), record.seed)


RESCUES_PER_EPISODE = Measure(
    name="rescues_per_episode",
    unit="",
    meaning="rescues in an episode",
    of=rescues_per_episode,
)
