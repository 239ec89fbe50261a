"""What a run is compared by: how it shares work, how well it does, how even its attention is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.experiments.crossed.arms import Arm
from innerattn.experiments.paper.workload import rescues_by_task
from innerattn.experiments.run import FinishedRun
from innerattn.measures.registry import measure_of

IDLE = 0.2
"""A food robot with a smaller share of the rescues than this counts as idle."""

OUTCOMES = {
    "imbalance": "distance of the first food robot's share from 0.5, a mean over tasks",
    "least_share": "share of all rescues by the food robot that has fewer",
    "rescues_per_episode": "rescues in an episode of the standard length",
    "score": "0 random play, 1 scripted dispatch",
    "entropy_share": "entropy of attention as a share of ln(N - 1), over robots and heads",
    "first_share": "share of all rescues by the first food robot",
}
"""The outcomes of a run and what they are."""


@dataclass(frozen=True)
class Outcome:
    """The outcomes of one run by the names of `OUTCOMES`; None where it has none."""

    imbalance: float | None
    least_share: float | None
    rescues_per_episode: float
    score: float | None
    entropy_share: float | None
    first_share: float | None


Outcomes = Mapping[Arm, Mapping[int, Outcome]]
"""The outcomes of the runs of each arm, by their seeds."""


def outcome_of(run: FinishedRun) -> Outcome:
    """The outcomes of a run; shares are over all its episodes of the standard length.

    Raises:
        RunError: a task is not one that two robots share.
    """
    total = np.sum(list(rescues_by_task(run).values()), axis=0)
    summary, imbalance = run.summary, measure_of("imbalance", *run.scored)
    return Outcome(
        imbalance=imbalance if isinstance(imbalance, float) else None,
        least_share=float(total.min() / total.sum()) if total.sum() else None,
        rescues_per_episode=float(summary["rescues_per_episode"]["mean"]),
        score=None if summary["score"] is None else float(summary["score"]["mean"]),
        entropy_share=_mean(summary["attention_entropy_share"]),
        first_share=float(total[0] / total.sum()) if total.sum() else None,
    )


def by_seed(outcomes: Outcomes, arms: Sequence[Arm], name: str) -> NDArray[np.float64]:
    """An outcome of the runs of some arms: (n, k), a row for each seed that has it in all k."""
    runs = [outcomes.get(arm, {}) for arm in arms]
    seeds = sorted(set.intersection(*(set(of_arm) for of_arm in runs)))
    rows = [[getattr(of_arm[seed], name) for of_arm in runs] for seed in seeds]
    return np.array([row for row in rows if None not in row], np.float64).reshape(-1, len(arms))


def _mean(rows: dict[str, Sequence[float | None]]) -> float | None:
    values = [value for row in rows.values() for value in row if value is not None]
    return float(np.mean(values)) if values else None
