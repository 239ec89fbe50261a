"""Handoffs (Fig. 5): a robot completes one task with one partner, the next with another.

They are found in rescue events; `handoff_attention` measures what attention does around them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.records.record import Record

HANDOFF = np.dtype(
    [
        (name, np.int64)
        for name in ("episode", "robot", "before", "after", "start", "first", "second")
    ]
)
"""A handoff. episode: its number; robot: who hands over; before, after: its partners in the first
and the second rescue; start: step after its last rescue before these, or 0; first, second: steps of
the two rescues. Fig. 5's pre-stage is start to first, its later stages first + 1 to second."""


def handoffs(record: Record, robot: str, first_task: str, later_task: str) -> NDArray[np.void]:
    """All handoffs of one robot from one task to another.

    Args:
        record: where to look.
        robot: name of the robot, such as "food_0".
        first_task: name of the task of the first rescue, such as "task_1".
        later_task: name of the task of the very next rescue the robot takes part in.

    Returns:
        (N,) `HANDOFF`, in the order of episodes and of time; those with the same partner in both
        rescues are left out.

    Raises:
        ValueError: no such robot or task, the tasks are the same, or one has not two needs, so that
            there is no one partner.
    """
    index = _index("robot", robot, record.robot_names)
    names = [task.name for task in record.scenario.tasks]
    tasks = [_index("task", name, names) for name in (first_task, later_task)]
    if first_task == later_task:
        raise ValueError(f"first_task and later_task are both {first_task!r}: must differ")
    for task in tasks:
        needs = record.scenario.tasks[task].needs
        if len(needs) != 2:
            raise ValueError(f"task {names[task]!r} has {len(needs)} needs: must have 2")
    events = record.rescues
    helpers = np.stack([events["helper_0"], events["helper_1"]], -1)
    own = _own_rescues(events, index)
    events, helpers = events[own], helpers[own]
    same = events["episode"][1:] == events["episode"][:-1]
    wanted = (events["task"][:-1] == tasks[0]) & (events["task"][1:] == tasks[1])
    partner = np.where(helpers[:, 0] == index, helpers[:, 1], helpers[:, 0])
    chosen = np.flatnonzero(same & wanted & (partner[1:] != partner[:-1]))
    found = np.zeros(len(chosen), HANDOFF)
    earlier = np.maximum(chosen - 1, 0)
    again = (chosen > 0) & (events["episode"][earlier] == events["episode"][chosen])
    found["episode"], found["robot"] = events["episode"][chosen], index
    found["before"], found["after"] = partner[chosen], partner[chosen + 1]
    found["start"] = np.where(again, events["step"][earlier] + 1, 0)
    found["first"], found["second"] = events["step"][chosen], events["step"][chosen + 1]
    return found


def _own_rescues(events: NDArray[np.void], robot: int) -> NDArray[np.int64]:
    """Indices of the rescues that the robot took part in, by episode and then by time."""
    helped = np.zeros(len(events), bool)
    for name in events.dtype.names or ():
        if name.startswith("helper_"):
            helped |= events[name] == robot
    order = np.lexsort((events["step"], events["episode"]))
    return order[helped[order]]


def _index(what: str, name: str, names: list[str] | tuple[str, ...]) -> int:
    if name not in names:
        raise ValueError(f"{what} {name!r}: known are {', '.join(names)}")
    return list(names).index(name)
