"""Which robot goes to which victim: at most one robot for a need, at most one need for a robot.

It knows costs and no geometry. `assign` solves many small problems at once and gives what
`scipy.optimize.linear_sum_assignment` gives for each.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations
from math import perm

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario

FORBIDDEN = 1e7
"""Cost of a pair that cannot be [s]; so much that a permitted pair is always preferred."""

_MOST_PLANS = 1000  # beyond, solving each world on its own is the faster way
_OWN_SHARE = 0.3
_HOLD_S = 2e4
"""More than any other plan saves, and little beside `FORBIDDEN`, for 64 robots together."""
_WAIT_S = 2 * _HOLD_S
"""More than `_HOLD_S`: nobody stays at a victim that waits while there is another one to help."""


class Needs:
    """What victims need and who can give it.

    Attributes:
        able: (R, A) bool, robot has ability (abilities sorted).
        of_task: (K, N) int64, ability of each need of each task, -1 beyond a task's last; needs
            may be sums, see `coalitions`.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Take abilities and tasks from ``scenario``."""
        abilities = sorted({ability for robot in scenario.robots for ability in robot.abilities})
        self.able: NDArray[np.bool_] = np.array(
            [[ability in robot.abilities for ability in abilities] for robot in scenario.robots]
        )
        most = max(len(task.needs) for task in scenario.tasks)
        rows = [[abilities.index(need) for need in task.needs] for task in scenario.tasks]
        self.of_task = np.array([row + [-1] * (most - len(row)) for row in rows], np.int64)

    def permitted(self, present: NDArray[np.bool_], task: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which robot can fill which need.

        Args:
            present: (E, V) whether the slot holds a victim.
            task: (E, V) index of its task.

        Returns:
            (E, R, V, N) bool.
        """
        needs = self.of_task[np.where(present, task, 0)]
        able = self.able.T[needs] & ((needs >= 0) & present[:, :, None])[..., None]
        return np.asarray(able.transpose(0, 3, 1, 2))


def pair_costs(
    times: NDArray[np.float64],
    permitted: NDArray[np.bool_],
    held: NDArray[np.bool_] | None = None,
    blocked: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Cost of sending a robot to fill a need of a victim.

    A victim is rescued when the last helper is there, so a robot's cost is its own arrival time or,
    if later, the earliest time at which every other need, each for itself, could be filled; a share
    of its own arrival time decides between robots that would both be early.

    Args:
        times: (E, R, V) arrival times [s].
        permitted: (E, R, V, N) which robot can fill which need.
        held: (E, R, V) robots that must go on with the service of a victim, if they can; None:
            nobody.
        blocked: (E, V) victims that have to wait for others, to which only robots go that no other
            victim needs; None: none.

    Returns:
        (E, R, V * N) float64 [s], `FORBIDDEN` where not permitted.
    """
    own = times[..., None]
    soonest = np.where(permitted, own, np.inf).min(1)
    soonest = np.where(np.isfinite(soonest), soonest, 0.0)
    # Leaving a robot's own need in does no harm: nobody fills it sooner than the soonest.
    last = soonest.max(-1)[:, None, :, None]
    costs = np.maximum(own, last) + _OWN_SHARE * own
    if held is not None:
        costs = costs - _HOLD_S * held[..., None]
    if blocked is not None:
        costs = costs + _WAIT_S * blocked[:, None, :, None]
    costs = np.where(permitted, costs, FORBIDDEN)
    return costs.reshape(*times.shape[:2], -1)


def can_be_rescued(permitted: NDArray[np.bool_], needed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether robots can fill all needs of a victim at once, each robot one of them.

    Args:
        permitted: (E, R, V, N) which robot can fill which need.
        needed: (E, V, N) the needs that there are.

    Returns:
        (E, V) bool; True where nothing is needed.
    """
    worlds, robots, victims, needs = permitted.shape
    pairs = permitted.transpose(0, 2, 1, 3).reshape(-1, robots, needs)
    filled = (assign(np.where(pairs, 0.0, FORBIDDEN)) >= 0).sum(1).reshape(worlds, victims)
    return np.asarray(filled == needed.sum(-1))


def assign(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    """The cheapest assignment of robots to needs in every world.

    Args:
        costs: (E, R, S) cost of robot r filling need s; `FORBIDDEN` where it cannot.

    Returns:
        (E, R) int64 index of the robot's need, -1 for a robot without one. As many robots as
        possible are assigned, at the least total cost.
    """
    _, robots, slots = costs.shape
    if perm(max(robots, slots), min(robots, slots)) <= _MOST_PLANS:
        chosen = _by_enumeration(costs)
    else:
        chosen = _one_by_one(costs)
    cost = np.take_along_axis(costs, np.maximum(chosen, 0)[..., None], -1)[..., 0]
    return np.where((chosen >= 0) & (cost < FORBIDDEN), chosen, -1)


def assign_whole_teams(costs: NDArray[np.float64], needed: NDArray[np.bool_]) -> NDArray[np.int64]:
    """As `assign`, but where no victim would get all its helpers, whole teams come first.

    At the least total cost robots may wait at several victims for helpers who wait at others. If
    so, and robots can fill all needs of some victim, the victim whose team is there soonest gets
    it, then the next one of the robots that are left, and so on; the rest are assigned as ever.

    Args:
        costs: (E, R, V * N) cost of robot r filling a need of a victim; `FORBIDDEN` where it
            cannot.
        needed: (E, V, N) the needs that there are.

    Returns:
        (E, R) int64 as that of `assign`.
    """
    chosen = assign(costs)
    wanted = needed.sum(-1)
    victims = np.where(chosen >= 0, chosen // needed.shape[-1], -1)
    coming = (victims[..., None] == np.arange(needed.shape[1])).sum(1)
    alone = ~((coming == wanted) & (wanted > 0)).any(1) & (coming > 0).any(1)
    if alone.any():
        chosen[alone] = _teams_first(costs[alone], wanted[alone])
    return chosen


def _teams_first(costs: NDArray[np.float64], wanted: NDArray[np.int64]) -> NDArray[np.int64]:
    """What `assign_whole_teams` does where no victim would get all its helpers.

    Args:
        costs: (E, R, V * N).
        wanted: (E, V) number of helpers that each victim needs.
    """
    worlds, robots, _ = costs.shape
    victims = wanted.shape[1]
    left = costs.reshape(worlds, robots, victims, -1).copy()
    needs = left.shape[-1]
    chosen = np.full((worlds, robots), -1, np.int64)
    every = np.arange(worlds)
    for _ in range(victims):
        team = assign(left.transpose(0, 2, 1, 3).reshape(-1, robots, needs))
        team = team.reshape(worlds, victims, robots)
        comes = team >= 0
        cost = np.take_along_axis(left.transpose(0, 2, 1, 3), np.maximum(team, 0)[..., None], -1)[
            ..., 0
        ]
        latest = np.where(comes, cost, -np.inf).max(-1)
        # A service that goes on does so first.
        latest = np.where((comes & (cost < 0.0)).any(-1), latest - _HOLD_S, latest)
        latest = np.where((comes.sum(-1) == wanted) & (wanted > 0), latest, np.inf)
        first = latest.argmin(1)
        taken = comes[every, first] & np.isfinite(latest[every, first])[:, None]
        if not taken.any():
            break
        chosen = np.where(taken, first[:, None] * needs + team[every, first], chosen)
        left = np.where(taken[:, :, None, None], FORBIDDEN, left)
        some = taken.any(1)
        left[every[some], :, first[some]] = FORBIDDEN
    rest = assign(left.reshape(worlds, robots, -1))
    return np.where(chosen >= 0, chosen, rest)


def _by_enumeration(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    """Price every plan of every world at once; for small teams far faster than solving each."""
    plans, chosen = _plans(*costs.shape[1:])
    totals = costs.reshape(len(costs), -1) @ plans
    return np.asarray(chosen[totals.argmin(1)])


@lru_cache(maxsize=16)
def _plans(robots: int, slots: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All ways to assign as many robots as there are needs, or the other way round.

    Returns:
        (R * S, P) float64 one column of zeros and ones per plan, and (P, R) int64 the need of each
        robot in each plan, -1 for none.
    """
    if robots <= slots:
        chosen = np.array(list(permutations(range(slots), robots)), np.int64)
    else:
        fillers = np.array(list(permutations(range(robots), slots)), np.int64)
        chosen = np.full((len(fillers), robots), -1, np.int64)
        np.put_along_axis(chosen, fillers, np.arange(slots)[None], 1)
    pairs = chosen[..., None] == np.arange(slots)
    return pairs.reshape(len(chosen), -1).T.astype(np.float64), chosen


def _one_by_one(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    from scipy.optimize import linear_sum_assignment  # takes longer to import than all else here

    chosen = np.full(costs.shape[:2], -1, np.int64)
    for row, cost in zip(chosen, costs, strict=True):
        robots, slots = linear_sum_assignment(cost)
        row[robots] = slots
    return chosen
