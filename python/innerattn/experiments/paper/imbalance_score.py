"""The correlation of workload imbalance and score: do imbalanced runs of a method score more?

Runs of one seed begin alike and are measured in the same worlds, so they are not independent. The
p-value is of a permutation test that exchanges the scores of whole seeds, for all methods together.
In the published runs (four methods, five seeds) it is 0.058 in double, 0.058 in mixed and 0.88 in
single; a t-test that takes the 20 runs of a situation for independent gives 0.019, 0.018 and 0.84.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from innerattn.experiments.paper.competence import Competence
from innerattn.experiments.paper.pairs import LEAST_PAIRS
from innerattn.policies import SCRIPTED
from innerattn.stats import Estimate
from innerattn.stats.permutation import permutation_test
from innerattn.stats.seeds import Array

_SCRIPT = "hungarian"
_PERMUTATIONS = 9_999  # all of them up to seven seeds
_SEED = 0  # of the permutations


@dataclass(frozen=True)
class ImbalanceScoreCorrelation:
    """The correlation of imbalance and score in one situation.

    Attributes:
        situation: of the worlds.
        runs: those that are correlated: of all methods, with the seeds that every method has.
        correlation: Pearson's, of imbalance and score, each minus its method's mean; positive where
            imbalanced runs score more. None where either does not vary, or there are fewer than
            `LEAST_PAIRS` seeds.
        p: two-sided, of no correlation, by exchanging whole seeds; None where the correlation is.
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
    scripts = {part.situation: part.mean for part in competence if part.method == _SCRIPT}
    found = []
    for situation in dict.fromkeys(part.situation for part in trained):
        imbalance, score = _by_method([part for part in trained if part.situation == situation])
        script = scripts.get(situation, {})
        beside = (_mean(script.get("imbalance")), _mean(script.get("score")))
        found.append(
            ImbalanceScoreCorrelation(
                situation, imbalance.size, *correlation_over_seeds(imbalance, score), beside
            )
        )
    return found


def correlation_over_seeds(x: Array, y: Array) -> tuple[float | None, float | None]:
    """The correlation of two values of runs within methods, and its p-value with seeds as blocks.

    If y does not depend on x within a seed's runs, the columns of y can be exchanged as they are:
    what the runs of one seed have in common stays together. p is the share of all S! exchanges, or
    of 9,999 random ones, whose correlation is at least as far from 0.

    Args:
        x: (M, S) by method and seed.
        y: (M, S) likewise.

    Returns:
        Correlation and p-value; both None where x or y does not vary within methods, or S is less
        than `LEAST_PAIRS`.
    """
    if x.shape[1] < LEAST_PAIRS:
        return None, None
    x, y = (values - values.mean(1, keepdims=True) for values in (x, y))
    scale = math.sqrt(float((x**2).sum() * (y**2).sum()))
    if scale < 1e-12:
        return None, None

    def strength(*samples: Array, axis: int) -> Array:
        (seeds,) = samples
        assert axis == -1
        return np.asarray(np.abs(np.einsum("ms,m...s->...", x, y[:, seeds.astype(np.int64)])))

    test = permutation_test(
        [np.arange(float(x.shape[1]))], strength, "pairings", _SEED, _PERMUTATIONS, "greater"
    )
    return float(np.clip((x * y).sum() / scale, -1.0, 1.0)), test.p


def _by_method(parts: Sequence[Competence]) -> tuple[Array, Array]:
    """Imbalance and score (M, S) of the M methods, for the S seeds that all of them have."""
    known = [
        {
            seed: (values["imbalance"], values["score"])
            for seed, values in zip(part.seeds, part.each, strict=True)
            if values["imbalance"] is not None and values["score"] is not None
        }
        for part in parts
    ]
    seeds = sorted(set.intersection(*(set(of_method) for of_method in known)))
    pairs = np.array([[of_method[seed] for seed in seeds] for of_method in known], np.float64)
    imbalance, score = pairs.reshape(len(known), len(seeds), 2).transpose(2, 0, 1)
    return imbalance, score


def _mean(value: Estimate | None) -> float | None:
    return value.mean if value else None
