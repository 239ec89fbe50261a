"""Who rescues with whom, counted from rescue events (eq. 10); arrivals play no part."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario, Task


def shared_abilities(scenario: Scenario) -> tuple[str, ...]:
    """Abilities that several robots have, sorted: where there is a choice of whom to send."""
    owners = Counter(ability for robot in scenario.robots for ability in set(robot.abilities))
    return tuple(sorted(ability for ability, count in owners.items() if count > 1))


def columns_of_choices(task: Task, shared: set[str], rescues: NDArray[np.void]) -> list[str]:
    """The columns of events of ``task`` whose helpers could have been others.

    Those of the needs that several robots can meet; where needs are sums, those of all helpers.
    """
    if task.sums:
        return [name for name in rescues.dtype.names or () if name.startswith("helper_")]
    return [f"helper_{need}" for need, ability in enumerate(task.roles) if ability in shared]


def count_cooperation(rescues: NDArray[np.void], scenario: Scenario) -> dict[str, dict[str, int]]:
    """Rescues of each task by each robot that helped where another could have (Table II).

    Args:
        rescues: (N,) structured events; fields task, helper_0, helper_1, ... are used.
        scenario: the worlds they come from.

    Returns:
        For each task, in order, the number of rescues by robot: of all robots, in order, with a
        shared ability that the task needs. In the default team these are the two food robots.
        Where needs are sums every helper with such an ability counts.
    """
    shared = set(shared_abilities(scenario))
    counts: dict[str, dict[str, int]] = {}
    for index, task in enumerate(scenario.tasks):
        of_task = rescues[rescues["task"] == index]
        total = np.zeros(scenario.num_robots, np.int64)
        for name in columns_of_choices(task, shared, rescues):
            helper = of_task[name]
            total += np.bincount(helper[helper >= 0], minlength=len(total))
        chosen = shared & set(task.needs)
        counts[task.name] = {
            robot.name: int(total[i])
            for i, robot in enumerate(scenario.robots)
            if chosen & set(robot.abilities)
        }
    return counts


def count_pairs(rescues: NDArray[np.void], num_robots: int) -> NDArray[np.int64]:
    """``Num_ij`` of eq. 10: rescues in which robots i and j both helped.

    Args:
        rescues: (N,) structured events; fields helper_0, helper_1, ... are used, -1 is nobody.
        num_robots: R.

    Returns:
        (R, R) int64, symmetric; the diagonal is 0.
    """
    helpers = [name for name in rescues.dtype.names or () if name.startswith("helper_")]
    helped = np.zeros((len(rescues), num_robots + 1), np.int64)
    for name in helpers:
        helped[np.arange(len(rescues)), rescues[name]] = 1  # -1 falls into the last column
    pairs = helped[:, :num_robots].T @ helped[:, :num_robots]
    np.fill_diagonal(pairs, 0)
    return pairs


def pair_rates(pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """``rate_ij = Num_ij / sum_k Num_ik`` (eq. 10).

    Args:
        pairs: (R, R) what `count_pairs` gives.

    Returns:
        (R, R) float64; rows sum to 1, and are NaN for a robot that never helped with another.
    """
    total = pairs.sum(1, keepdims=True)
    return np.where(total > 0, pairs / np.maximum(total, 1), np.nan)
