"""How far from even two robots share the work, in one number."""

from __future__ import annotations

import numpy as np

from innerattn.measures.measure import Measure
from innerattn.measures.sharing.evenness import counts_by_episode
from innerattn.records.record import Record


def workload_imbalance(record: Record) -> float | None:
    """Distance of the first robot's share of the rescues from 0.5, a mean over tasks, 0 to 0.5.

    The share is over all episodes; see `innerattn.measures.cooperation.count_cooperation` for which
    rescues count.

    Returns:
        None where a task has no rescues, or is not one that exactly two robots share.
    """
    counts = [by_episode.sum(0) for by_episode in counts_by_episode(record).values()]
    if not all(len(by_robot) == 2 and by_robot.sum() for by_robot in counts):
        return None
    return float(np.mean([abs(first / (first + second) - 0.5) for first, second in counts]))


IMBALANCE = Measure(
    name="imbalance",
    unit="distance of a share from 0.5",
    meaning="how far from even two robots share the rescues of a task, a mean over tasks",
    of=workload_imbalance,
)
