"""Whether evenness is a merit: do the uneven runs of a method score less than its even ones?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from innerattn.experiments.paper.competence import Competence
from innerattn.policies import SCRIPTED
from innerattn.stats.seeds import Array, OverRuns

_SCRIPT = "hungarian"


@dataclass(frozen=True)
class Merit:
    """How unevenness goes with the score in one situation.

    Attributes:
        situation: of the worlds.
        runs: those of methods with several runs.
        correlation: Pearson's, of unevenness and score, each less its method's mean; positive where
            uneven runs score more. None where either does not vary, or runs are too few to judge.
        p: two-sided, of no correlation, as if runs of one seed had nothing in common.
        script: unevenness and score of the scripted assignment in the same worlds; None where it
            has none.
    """

    situation: str
    runs: int
    correlation: float | None
    p: float | None
    script: tuple[float | None, float | None]


def merits(competence: Sequence[Competence]) -> list[Merit]:
    """Of every situation with trained runs."""
    trained = [part for part in competence if part.method not in SCRIPTED]
    return [
        _merit(situation, [part for part in competence if part.situation == situation])
        for situation in dict.fromkeys(part.situation for part in trained)
    ]


def _merit(situation: str, parts: Sequence[Competence]) -> Merit:
    groups = []
    for part in parts:
        pairs = [
            (figures["unevenness"], figures["score"])
            for figures in part.each
            if figures["unevenness"] is not None and figures["score"] is not None
        ]
        if part.method not in SCRIPTED and len(pairs) > 1:
            groups.append(np.array(pairs, np.float64))
    runs = sum(map(len, groups))
    script = next((part.mean for part in parts if part.method == _SCRIPT), {})
    beside = (_mean(script.get("unevenness")), _mean(script.get("score")))
    return Merit(situation, runs, *_correlation(groups, runs), beside)


def _mean(value: OverRuns | None) -> float | None:
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
