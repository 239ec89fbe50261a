"""Do the initial weights decide which food robot does more? Runs in which the two swap them.

A seed decides much (`innerattn.experiments.crossed.seed_effect`), but it gives the initial weights,
the worlds and all draws at once. Here each run of team credit has a second one beside it, of the
same seed, in which the two food robots begin with each other's weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.experiments.crossed.arms import SWAPPED
from innerattn.experiments.crossed.effects import LEAST_SEEDS
from innerattn.experiments.crossed.outcome import outcome_of
from innerattn.experiments.crossed.seed_effect import intraclass_correlation
from innerattn.experiments.run import FinishedRun
from innerattn.stats import Estimate


@dataclass(frozen=True)
class Pair:
    """The share of all rescues by the first food robot, in two runs of a seed.

    Attributes:
        seed: of both.
        drawn: with the weights as they were drawn.
        swapped: with the weights of the two food robots swapped.
    """

    seed: int
    drawn: float
    swapped: float


@dataclass(frozen=True)
class Swap:
    """What swapping does in one situation with one method.

    Attributes:
        situation: name of the built-in scenario.
        method: value of `train.method`.
        pairs: by seed.
        correlation: of the two runs of a seed, see `intraclass_correlation`: 1: the same robot does
            more, whatever its weights; -1: the larger share goes where the weights go; None with
            fewer than `LEAST_SEEDS` pairs.
        answer: "the weights" where the correlation's interval is below 0, "something else" where it
            is above 0, else "undecided".
    """

    situation: str
    method: str
    pairs: tuple[Pair, ...]
    correlation: Estimate | None
    answer: str


def read_swaps(runs: Sequence[FinishedRun]) -> list[Swap]:
    """Compare the runs of each situation and method; they are read only.

    Raises:
        RunError: records cannot be read, or a run's team has not two food robots.
    """
    shares: dict[tuple[str, str], tuple[dict[int, float], dict[int, float]]] = {}
    for run in runs:
        share, case = outcome_of(run).first_share, run.case
        group = shares.setdefault((case.worlds, case.method), ({}, {}))
        if share is not None:
            group[case.variant.endswith(SWAPPED)][case.seed] = share
    return [
        _swap(*key, [Pair(s, drawn[s], swapped[s]) for s in sorted(drawn.keys() & swapped.keys())])
        for key, (drawn, swapped) in shares.items()
    ]


def _swap(situation: str, method: str, pairs: Sequence[Pair]) -> Swap:
    correlation, answer = None, "undecided"
    if len(pairs) >= LEAST_SEEDS:
        correlation = intraclass_correlation([(one.drawn, one.swapped) for one in pairs])
    if correlation is not None and correlation.high < 0.0:
        answer = "the weights"
    elif correlation is not None and correlation.low > 0.0:
        answer = "something else"
    return Swap(situation, method, tuple(pairs), correlation, answer)
