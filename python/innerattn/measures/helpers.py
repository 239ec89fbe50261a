"""How many robots it takes where needs are sums, from records."""

from __future__ import annotations

import numpy as np

from innerattn.measures.measure import Measure
from innerattn.records.record import Record
from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval


def helpers_per_rescue(record: Record) -> Estimate | None:
    """Mean number of helpers of the victims whose needs are sums. The interval is over episodes.

    Returns:
        None where less than two episodes have such rescues.
    """
    of_sums = [index for index, task in enumerate(record.scenario.tasks) if task.sums]
    events = record.rescues[np.isin(record.rescues["task"], of_sums)]
    names = [name for name in events.dtype.names or () if name.startswith("helper_")]
    helpers = np.sum([events[name] >= 0 for name in names], axis=0)
    episode = events["episode"] - record.first_episode
    return ratio_interval(
        np.bincount(episode, helpers, record.num_episodes),
        np.bincount(episode, minlength=record.num_episodes),
    )


MEASURES = (
    Measure(
        name="helpers",
        unit="robots",
        meaning="robots that helped with each rescue of a victim whose needs are sums",
        of=helpers_per_rescue,
        applies=lambda scenario: any(task.sums for task in scenario.tasks),
    ),
)
