"""Learnt attention beside uniform attention: seed by seed, and over all situations together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from innerattn.experiments.paper.competence import Competence
from innerattn.measures.sharing.evenness import MARGIN
from innerattn.stats import Estimate
from innerattn.stats.aggregate import improvement_interval, iqm_interval
from innerattn.stats.comparison import Contrast, contrast
from innerattn.stats.seeds import seed_estimate

LEAST_PAIRS = 3
"""Two methods are compared over so many seeds that have a run of each, or not at all."""

MARGINS = {"score": 0.05, "imbalance": 0.5 - MARGIN[0]}
"""The values that are compared, and the largest difference that counts as none."""

_SEED = 0  # of the bootstraps
_LEAST_RUNS = 2  # of a method in a situation, for a bootstrap


@dataclass(frozen=True)
class Pair:
    """Learnt and uniform attention with one algorithm in one situation, by one value of the runs.

    Attributes:
        situation: of the worlds.
        algorithm: such as "td".
        measure: one of `MARGINS`.
        seeds: those that have a run of each with the value.
        inner: mean over these of learnt attention.
        uniform: the same of uniform attention.
        contrast: inner minus uniform with the seed as the unit; None where there are fewer than
            `LEAST_PAIRS` seeds, or all have the same difference.
    """

    situation: str
    algorithm: str
    measure: str
    seeds: tuple[int, ...]
    inner: Estimate | None
    uniform: Estimate | None
    contrast: Contrast | None


@dataclass(frozen=True)
class Together:
    """One algorithm over the situations in which both attentions have two runs or more.

    Attributes:
        algorithm: such as "td".
        situations: these.
        inner: interquartile mean of the score with learnt attention.
        uniform: the same with uniform attention.
        better: probability that a run with learnt attention scores higher than one without.
    """

    algorithm: str
    situations: tuple[str, ...]
    inner: Estimate
    uniform: Estimate
    better: Estimate


def pairs(competence: Sequence[Competence]) -> list[Pair]:
    """All pairs of a situation and algorithm with both attentions, by each of `MARGINS`."""
    all_pairs = []
    for (situation, algorithm), both in _matched(competence).items():
        for measure, margin in MARGINS.items():
            inner, uniform = (_by_seed(runs, measure) for runs in both)
            seeds = tuple(sorted(inner.keys() & uniform.keys()))
            values = [(inner[seed], uniform[seed]) for seed in seeds]
            enough = len(seeds) >= LEAST_PAIRS
            all_pairs.append(
                Pair(
                    *(situation, algorithm, measure, seeds),
                    inner=seed_estimate([inner[seed] for seed in seeds]),
                    uniform=seed_estimate([uniform[seed] for seed in seeds]),
                    contrast=contrast(values, (1.0, -1.0), margin) if enough else None,
                )
            )
    return all_pairs


def together(competence: Sequence[Competence]) -> list[Together]:
    """Each algorithm over all situations, by the score."""
    matched = _matched(competence)
    algorithms = []
    for algorithm in dict.fromkeys(algorithm for _, algorithm in matched):
        strata = {
            situation: [list(_by_seed(one, "score").values()) for one in both]
            for (situation, of), both in matched.items()
            if of == algorithm
        }
        whole = {s: both for s, both in strata.items() if min(map(len, both)) >= _LEAST_RUNS}
        if whole:
            inner, uniform = ([both[i] for both in whole.values()] for i in (0, 1))
            algorithms.append(
                Together(
                    algorithm,
                    tuple(whole),
                    iqm_interval(inner, _SEED),
                    iqm_interval(uniform, _SEED),
                    improvement_interval(inner, uniform, _SEED),
                )
            )
    return algorithms


def _matched(
    competence: Sequence[Competence],
) -> dict[tuple[str, str], tuple[Competence, Competence]]:
    """Learnt and uniform attention by situation and algorithm, where both are there."""
    known = {(one.situation, one.method): one for one in competence}
    return {
        (situation, algorithm): (one, other)
        for (situation, method), one in known.items()
        for algorithm, inner, kind in [method.rpartition("-")]
        if inner and kind == "inner" and (other := known.get((situation, f"{algorithm}-uniform")))
    }


def _by_seed(runs: Competence, measure: str) -> Mapping[int, float]:
    return {
        seed: value
        for seed, values in zip(runs.seeds, runs.each, strict=True)
        if (value := values[measure]) is not None
    }
