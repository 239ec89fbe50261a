"""How far from even robots share the work that several of them can do, in one number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.cooperation import columns_of_choices, shared_abilities
from innerattn.measures.measure import Measure
from innerattn.records.record import Record


def workload_imbalance(record: Record) -> float | None:
    """Part of the rescues that other robots would do if the work were shared evenly, 0 to 1.

    Rescues of a task are counted by the robots that met one of its needs, where several robots
    can. Of K such robots it is half the sum of |share - 1 / K|: |share - 0.5| of two, and at most
    1 - 1 / K. It is a mean over needs of all tasks, of shares over all episodes.

    Returns:
        None where no need can be met by several robots, or a task with such a need has no rescues.
    """
    counts = helpers_by_need(record)
    if not counts or not all(by_robot.sum() for by_robot in counts):
        return None
    return float(np.mean([_distance_from_even(by_robot) for by_robot in counts]))


def helpers_by_need(record: Record) -> list[NDArray[np.int64]]:
    """Rescues by robot for each task and each ability that it needs and several robots have.

    Where needs are sums, a helper counts for each ability that it has of them.

    Returns:
        (K,) counts each, of the K robots with the ability in their order.
    """
    robots, shared = record.scenario.robots, shared_abilities(record.scenario)
    found = []
    for index, task in enumerate(record.scenario.tasks):
        events = record.rescues[record.rescues["task"] == index]
        for ability in shared:
            if ability not in task.needs:
                continue
            columns = columns_of_choices(task, {ability}, events)
            helpers = np.concatenate([events[name] for name in columns])
            total = np.bincount(helpers[helpers >= 0], minlength=len(robots))
            found.append(total[[ability in robot.abilities for robot in robots]].astype(np.int64))
    return found


def _distance_from_even(counts: NDArray[np.int64]) -> float:
    return float(np.abs(counts / counts.sum() - 1.0 / len(counts)).sum() / 2.0)


IMBALANCE = Measure(
    name="imbalance",
    unit="share of the rescues",
    meaning="share of the rescues that other robots would do if the work were shared evenly",
    of=workload_imbalance,
)
