"""Handoffs (Fig. 5): a robot completes one task with one partner, the next with another.

They are read off rescue events; `handoff_attention` measures attention around them.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.cooperation import shared_abilities
from innerattn.records.record import Record

Steps = NDArray[np.int64]

HANDOFF = np.dtype(
    [
        (name, np.int64)
        for name in ("episode", "robot", "before", "after", "start", "first", "second")
    ]
)
"""A handoff. episode: its number; robot: who hands over; before, after: its partners in the first
and the second rescue; start: step after its last rescue before these, or 0; first, second: steps of
the two rescues. Fig. 5's pre-stage is start to first, its later stages first + 1 to second."""

REACH = 8
"""Steps on either side of the first rescue that the window of a handoff has at most."""


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
        needs = record.scenario.tasks[task].roles
        if len(needs) != 2:
            raise ValueError(f"task {names[task]!r} has {len(needs)} needs: must have a list of 2")
    events = record.rescues
    helpers = np.stack([events["helper_0"], events["helper_1"]], -1)
    own = _own_rescues(events, index)
    events, helpers = events[own], helpers[own]
    same = events["episode"][1:] == events["episode"][:-1]
    wanted = (events["task"][:-1] == tasks[0]) & (events["task"][1:] == tasks[1])
    partner = np.where(helpers[:, 0] == index, helpers[:, 1], helpers[:, 0])
    chosen = np.flatnonzero(same & wanted & (partner[1:] != partner[:-1]))
    rows = np.zeros(len(chosen), HANDOFF)
    earlier = np.maximum(chosen - 1, 0)
    again = (chosen > 0) & (events["episode"][earlier] == events["episode"][chosen])
    rows["episode"], rows["robot"] = events["episode"][chosen], index
    rows["before"], rows["after"] = partner[chosen], partner[chosen + 1]
    rows["start"] = np.where(again, events["step"][earlier] + 1, 0)
    rows["first"], rows["second"] = events["step"][chosen], events["step"][chosen + 1]
    return rows


def all_handoffs(record: Record) -> NDArray[np.void]:
    """The handoffs of all robots that share an ability, between any two tasks of two needs.

    Returns:
        (N,) `HANDOFF`, by robot, then by order of the tasks.
    """
    tasks = [task.name for task in record.scenario.tasks if len(task.roles) == 2]
    rows = [
        handoffs(record, robot, first, later)
        for robot in alike_robots(record)
        for first, later in permutations(tasks, 2)
    ]
    return np.concatenate([np.zeros(0, HANDOFF), *rows])


def alike_robots(record: Record) -> tuple[str, ...]:
    """Names of the robots with the first ability that several have; the two food robots."""
    robots, shared = record.scenario.robots, shared_abilities(record.scenario)
    return tuple(robot.name for robot in robots if shared and shared[0] in robot.abilities)


def with_control(record: Record, events: NDArray[np.void]) -> NDArray[np.void]:
    """The same handoffs with ``robot`` replaced by the next of the robots alike."""
    alike = [record.robot_names.index(name) for name in alike_robots(record)]
    other = dict(zip(alike, alike[1:] + alike[:1], strict=True))
    control = events.copy()
    control["robot"] = [other[robot] for robot in events["robot"].tolist()]
    return control


def window(handoffs: NDArray[np.void], reach: int = REACH) -> tuple[Steps, Steps]:
    """First and last step, (N,) each, of the handoffs' own stages within reach of the first rescue.

    Args:
        handoffs: (N,) `HANDOFF`.
        reach: steps up to the first rescue's, and steps after it.
    """
    return (
        np.maximum(handoffs["start"], handoffs["first"] + 1 - reach),
        np.minimum(handoffs["second"], handoffs["first"] + reach),
    )


def rescues_nobody(
    record: Record, handoffs: NDArray[np.void], reach: int = REACH
) -> NDArray[np.bool_]:
    """Whether the robot in ``robot`` takes part in no rescue within the window, (N,) bool.

    With ``robot`` replaced by another one, these are the handoffs at which the other does nothing.

    Args:
        record: the one that the handoffs are of.
        handoffs: (N,) `HANDOFF`.
        reach: see `window`.
    """
    low, high = window(handoffs, reach)
    idle = np.ones(len(handoffs), np.bool_)
    for robot in np.unique(handoffs["robot"]):
        events = record.rescues[_own_rescues(record.rescues, int(robot))]
        own = handoffs["robot"] == robot
        same = handoffs["episode"][own, None] == events["episode"]
        within = (low[own, None] <= events["step"]) & (events["step"] <= high[own, None])
        idle[own] = ~(same & within).any(1)
    return idle


def need_following_attention(record: Record) -> NDArray[np.float32]:
    """The attention of robots that each attend to the partners of their own next rescue alone.

    It is the reference that recorded attention is compared with: no attention that follows the
    work of a robot changes more at a handoff.

    Returns:
        (E, T, 1, R, R) weights; even where a robot takes part in no later rescue of the episode.
    """
    robots = record.scenario.num_robots
    even = (1.0 - np.eye(robots)) / max(robots - 1, 1)
    shape = (record.num_episodes, record.scenario.episode_steps, 1, robots, robots)
    weights = np.broadcast_to(even, shape).astype(np.float32)
    helpers = np.zeros((len(record.rescues), robots), np.bool_)
    for name in record.rescues.dtype.names or ():
        if name.startswith("helper_"):
            someone = record.rescues[name] >= 0
            helpers[someone, record.rescues[name][someone]] = True
    for robot in range(robots):
        begin = np.zeros(record.num_episodes, np.int64)
        for event in _own_rescues(record.rescues, robot):
            episode = record.rescues["episode"][event] - record.first_episode
            step = record.rescues["step"][event] + 1
            partners = helpers[event].copy()
            partners[robot] = False
            if partners.any():
                share = partners / partners.sum()
                weights[episode, begin[episode] : step, 0, robot] = share
            begin[episode] = step
    return weights


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
