"""How far from even two robots share rescues, in one number; it knows no run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.sharing.evenness import counts_by_episode
from innerattn.records.record import Record


def rescues_by_task(records: Sequence[Record]) -> dict[str, NDArray[np.int64]]:
    """Rescues of each task by the robots that could help with it, over all episodes.

    Args:
        records: of one policy in one scenario, at least one.

    Returns:
        By task (K,) int64; K robots have an ability that it needs and that several have.
    """
    parts = [counts_by_episode(record) for record in records]
    return {task: np.sum([part[task].sum(0) for part in parts], 0) for task in parts[0]}


def workload_imbalance(records: Sequence[Record]) -> float | None:
    """Distance of the first robot's share of the rescues from 0.5, a mean over tasks, 0 to 0.5.

    Args:
        records: as for `rescues_by_task`.

    Returns:
        None where a task is not shared by two robots, or has no rescue.
    """
    counts = list(rescues_by_task(records).values())
    if not all(len(by_robot) == 2 and by_robot.sum() for by_robot in counts):
        return None
    return float(np.mean([abs(first / (first + second) - 0.5) for first, second in counts]))
