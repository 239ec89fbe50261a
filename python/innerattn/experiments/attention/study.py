"""Scores of teams that learnt with inner attention minus those of other critics, seed by seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from innerattn.experiments.attention.arms import LEARNT
from innerattn.experiments.learning.study import Learnt, read_learning
from innerattn.experiments.paper.claims import LEAST_PAIRS
from innerattn.experiments.run import FinishedRun
from innerattn.stats.comparison import ALPHA, Contrast, contrast, holm

MARGIN = 0.03
"""Smaller differences of scores count as none; one run's score has an interval of ± 0.02."""

Verdict = Literal["better", "worse", "alike", "undecided"]

RULES = f"""\
- **Unit.** The seed is the unit. Runs of one seed are measured in the same worlds. Each seed gives
  one difference of scores. {LEAST_PAIRS} seeds or more make a comparison.
- **Intervals** are 95 %, by Student's t over seeds.
- **Better** or **worse**: Holm's p is below 5 %. It is adjusted for all comparisons at the same
  length of episodes, over all situations.
- **Alike**: not better or worse, and two one-sided tests at 5 % put the difference within
  {MARGIN:g}.
- **Undecided**: none of these.
- The score in the shorter episodes decides. The longer ones are shown beside it.
- Every finished run counts. Failed runs are listed."""


@dataclass(frozen=True)
class Comparison:
    """Scores with inner attention minus those of another method, in one situation.

    Attributes:
        situation: of the worlds.
        other: the other method.
        seeds: those that have a run of each.
        episode_steps: length of the episodes [control steps].
        difference: None where all seeds have the same.
        holm_p: adjusted for all comparisons at this length; None without a difference.
        verdict: on inner attention, by `RULES`.
    """

    situation: str
    other: str
    seeds: tuple[int, ...]
    episode_steps: int
    difference: Contrast | None
    holm_p: float | None = None
    verdict: Verdict = "undecided"


@dataclass(frozen=True)
class AttentionStudy:
    """What runs say of learnt attention.

    Attributes:
        learnt: scores by method, then situation.
        comparisons: in the shorter episodes, by situation, then method.
        long_comparisons: the same in the longer ones.
    """

    learnt: tuple[Learnt, ...]
    comparisons: tuple[Comparison, ...]
    long_comparisons: tuple[Comparison, ...]


def read_attention(runs: Sequence[FinishedRun]) -> AttentionStudy:
    """Compare methods; runs are read only.

    Raises:
        RunError: there are no runs, or they cannot be compared.
    """
    learnt = read_learning([replace(run, archived=True) for run in runs]).learnt
    return AttentionStudy(learnt, _compared(learnt, long=False), _compared(learnt, long=True))


def _compared(learnt: Sequence[Learnt], *, long: bool) -> tuple[Comparison, ...]:
    found = []
    for situation in dict.fromkeys(one.situation for one in learnt):
        here = {one.trained: one for one in learnt if one.situation == situation}
        if LEARNT not in here:
            continue
        inner = _by_seed(here[LEARNT], long=long)
        for other, theirs in here.items():
            values = _by_seed(theirs, long=long)
            seeds = tuple(sorted(inner.keys() & values.keys()))
            if other == LEARNT or len(seeds) < LEAST_PAIRS:
                continue
            pairs = [(inner[seed], values[seed]) for seed in seeds]
            steps = theirs.episode_steps[int(long)]
            difference = contrast(pairs, (1.0, -1.0), MARGIN)
            found.append(Comparison(situation, other, seeds, steps, difference))
    adjusted = iter(holm([one.difference.p for one in found if one.difference is not None]))
    return tuple(
        one if one.difference is None else _judged(one, one.difference, next(adjusted))
        for one in found
    )


def _judged(one: Comparison, difference: Contrast, holm_p: float) -> Comparison:
    verdict: Verdict = "undecided"
    if holm_p < ALPHA:
        verdict = "better" if difference.difference.mean > 0.0 else "worse"
    elif difference.equivalent:
        verdict = "alike"
    return replace(one, holm_p=holm_p, verdict=verdict)


def _by_seed(one: Learnt, *, long: bool) -> dict[int, float]:
    values = (one.long_score if long else one.score).each
    return {seed: value for seed, value in zip(one.seeds, values, strict=True) if value is not None}
