"""What an algorithm scores over all scenarios of a study, as rliable defines it.

Source: Agarwal et al. 2021, "Deep reinforcement learning at the edge of the statistical precipice",
section 4. A task is a scenario; an algorithm is all else that a place in the grid names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from innerattn.stats import Estimate
from innerattn.stats.aggregate import iqm_interval
from innerattn.studies.results import Result
from innerattn.studies.space import Length, Value

THRESHOLDS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)
"""Scores at which a performance profile is given."""
TASK = "scenario"
"""The coordinate of the grid that names the task."""


@dataclass(frozen=True)
class Aggregate:
    """An algorithm over the tasks of a study.

    Attributes:
        algorithm: its place in the grid, without the scenario.
        scores: of its runs by task and seed.
        iqm: interquartile mean over all its runs, with the 95 % interval of a bootstrap within
            tasks; None where a task has fewer than two runs.
        above: share of its runs that score more than each of `THRESHOLDS`, a mean over tasks.
    """

    algorithm: Mapping[str, Value]
    scores: Mapping[str, Mapping[int, float]]
    iqm: Estimate | None
    above: tuple[float, ...]


def aggregate(results: Sequence[Result], length: Length) -> list[Aggregate]:
    """Aggregates of all algorithms, in the order of the grid; those without a score are left out.

    Args:
        results: finished runs.
        length: of the episodes.
    """
    groups: dict[tuple[tuple[str, Value], ...], dict[str, dict[int, float]]] = {}
    for one in results:
        score = one.value("score", length)
        if score is not None:
            tasks = groups.setdefault(tuple(algorithm_of(one).items()), {})
            tasks.setdefault(str(one.run.place[TASK]), {})[one.run.seed] = score
    return [
        Aggregate(dict(rest), tasks, _iqm(tasks.values()), performance_profile(tasks.values()))
        for rest, tasks in groups.items()
    ]


def algorithm_of(one: Result) -> dict[str, Value]:
    """The place of a run in the grid, without the scenario."""
    return {key: value for key, value in one.run.place.items() if key != TASK}


def performance_profile(tasks: Iterable[Mapping[int, float]]) -> tuple[float, ...]:
    """The share of runs that score more than each of `THRESHOLDS`, a mean over tasks.

    Args:
        tasks: scores by seed, of each task; each has one or more.
    """
    of_tasks = [np.array(list(scores.values())) for scores in tasks]
    return tuple(
        float(np.mean([(scores > threshold).mean() for scores in of_tasks]))
        for threshold in THRESHOLDS
    )


def _iqm(tasks: Iterable[Mapping[int, float]]) -> Estimate | None:
    strata = [list(scores.values()) for scores in tasks]
    return iqm_interval(strata, seed=0) if min(map(len, strata)) > 1 else None
