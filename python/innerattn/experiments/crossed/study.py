"""The crossed design from finished runs, as data: outcomes, effects, answers, what a seed does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.experiments.crossed.arms import ARMS, Arm, arm_of
from innerattn.experiments.crossed.claims import Answer, answers
from innerattn.experiments.crossed.effects import Effect, effects
from innerattn.experiments.crossed.outcome import OUTCOMES, Outcome, outcome_of
from innerattn.experiments.crossed.seed_effect import SeedEffect, seed_effects
from innerattn.experiments.run import FinishedRun
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate


@dataclass(frozen=True)
class Situation:
    """What the runs of one situation show.

    Attributes:
        name: of the situation.
        runs: by arm, then seed.
        outcomes: of the runs by arm and seed; arms without runs are there, empty.
        means: over the runs of each arm, by the names of `OUTCOMES`; None where no run has one.
        effects: differences between arms.
        answers: what was expected, and whether it holds.
        seeds: how alike the runs of one seed are.
    """

    name: str
    runs: tuple[FinishedRun, ...]
    outcomes: dict[Arm, dict[int, Outcome]]
    means: dict[Arm, dict[str, Estimate | None]]
    effects: tuple[Effect, ...]
    answers: tuple[Answer, ...]
    seeds: tuple[SeedEffect, ...]


def read_situations(runs: Sequence[FinishedRun]) -> list[Situation]:
    """What the runs of each situation show; the runs are read only.

    Args:
        runs: finished runs of the design, in any order.

    Raises:
        RunError: records cannot be read, or a run's team has not two food robots.
    """
    names = dict.fromkeys(run.case.worlds for run in runs)
    return [_situation(name, [run for run in runs if run.case.worlds == name]) for name in names]


def _situation(name: str, own: Sequence[FinishedRun]) -> Situation:
    ordered = sorted(own, key=lambda run: (ARMS.index(arm_of(run.case)), run.seed))
    outcomes: dict[Arm, dict[int, Outcome]] = {arm: {} for arm in ARMS}
    for run in ordered:
        outcomes[arm_of(run.case)][run.seed] = outcome_of(run)
    means = {
        arm: {
            figure: seed_estimate([getattr(outcome, figure) for outcome in by_seed.values()])
            for figure in OUTCOMES
        }
        for arm, by_seed in outcomes.items()
    }
    compared = tuple(effects(name, outcomes))
    said = tuple(answers(name, outcomes, compared))
    seeds = tuple(seed_effects(outcomes))
    return Situation(name, tuple(ordered), outcomes, means, compared, said, seeds)
