"""Whether evenness is a merit: do the uneven runs of a method score less than its even ones?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from innerattn.experiments.paper.competence import Competence
from innerattn.policies import SCRIPTED
from innerattn.stats import Estimate
from innerattn.stats.seeds import Array

_SCRIPT = "hungarian"


@dataclass(frozen=True)
class ImbalanceScoreCorrelation:
    """How imbalance goes with the score in one situation.

    Attributes:
        situation: of the worlds.
        runs: those of methods with several runs.
        correlation: Pearson's, of imbalance and score, each less its method's mean; positive where
            uneven runs score more. None where either does not vary, or runs are too few to judge.
        p: two-sided, of no correlation, as if runs of one seed had nothing in common.
        script: imbalance and score of the scripted assignment in the same worlds; None where it
            has none.
    """

    situation: str
    runs: int
    correlation: float | None
    p: float | None
    script: tuple[float | None, float | None]


def imbalance_score_correlations(
    competence: Sequence[Competence],
) -> list[ImbalanceScoreCorrelation]:
    """Of every situation with trained runs."""
    trained = [part for part in competence if part.method not in SCRIPTED]
    return [
        _merit(situation, [part for part in competence if part.situation == situation])
        for situation in dict.fromkeys(part.situation for part in trained)
    ]


def _merit(situation: str, parts: Sequence[Competence]) -> ImbalanceScoreCorrelation:
    groups = []
    for part in parts:
        pairs = [
            (figures["imbalance"], figures["score"])
            for figures in part.each
            if figures["imbalance"] is not None and figures["score"] is not None
        ]
        if part.method not in SCRIPTED and len(pairs) > 1:
            groups.append(np.array(pairs, np.float64))
    runs = sum(map(len, groups))
    script = next((part.mean for part in parts if part.method == _SCRIPT), {})
    beside = (_mean(script.get("imbalance")), _mean(script.get("score")))
    return ImbalanceScoreCorrelation(situation, runs, *_correlation(groups, runs), beside)


def _mean(value: Estimate | None) -> float | None:
    return value.mean if value else None


def _correlation(groups: Sequence[Array], runs: int) -> tuple[float | None, float | None]:
    free = runs - len(groups) - 1  # a mean for each method, and the slope
    if free < 1:
        return None, None
    x, y = np.concatenate([group - group.mean(0) for group in groups]).T
    scale = math.sqrt(float((x**2).sum() * (y**2).sum()))
    if scale < 1e-12:
        return None, None
    found = float(np.clip((x * y).sum() / scale, -1.0, 1.0))
    if abs(found) == 1.0:
        return found, 0.0
    return found, float(2.0 * student.sf(abs(found) * math.sqrt(free / (1.0 - found**2)), free))
