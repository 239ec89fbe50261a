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
class CrossedRun:
    """A run of the design: how it was trained, and what it shows."""

    arm: Arm
    run: FinishedRun
    outcome: Outcome

    @property
    def seed(self) -> int:
        """The seed of its training."""
        return self.run.seed


@dataclass(frozen=True)
class Situation:
    """What the runs of one situation show.

    Attributes:
        name: of the situation.
        runs: by arm, then seed.
        means: over the runs of each arm, by the names of `OUTCOMES`; None where no run has one.
        effects: differences between arms.
        answers: what was expected, and whether it holds.
        seeds: how alike the runs of one seed are.
    """

    name: str
    runs: tuple[CrossedRun, ...]
    means: dict[Arm, dict[str, Estimate | None]]
    effects: tuple[Effect, ...]
    answers: tuple[Answer, ...]
    seeds: tuple[SeedEffect, ...]

    def outcomes(self) -> dict[Arm, dict[int, Outcome]]:
        """What the runs show by arm and seed; arms without runs are there, empty."""
        return _by_arm(self.runs)


def read_situations(runs: Sequence[FinishedRun]) -> list[Situation]:
    """What the runs of each situation show; the runs are read only.

    Args:
        runs: finished runs of the design, in any order.

    Raises:
        RunError: records cannot be read, or a run's team has not two food robots.
    """
    names = list(dict.fromkeys(run.case.worlds for run in runs))
    return [_situation(name, [run for run in runs if run.case.worlds == name]) for name in names]


def _situation(name: str, own: Sequence[FinishedRun]) -> Situation:
    order = {arm: index for index, arm in enumerate(ARMS)}
    found = [CrossedRun(arm_of(run.case), run, outcome_of(run)) for run in own]
    found.sort(key=lambda one: (order[one.arm], one.seed))
    outcomes = _by_arm(found)
    means = {
        arm: {
            figure: seed_estimate([getattr(outcome, figure) for outcome in by_seed.values()])
            for figure in OUTCOMES
        }
        for arm, by_seed in outcomes.items()
    }
    compared = tuple(effects(name, outcomes))
    said = tuple(answers(name, outcomes, compared))
    return Situation(name, tuple(found), means, compared, said, tuple(seed_effects(outcomes)))


def _by_arm(runs: Sequence[CrossedRun]) -> dict[Arm, dict[int, Outcome]]:
    return {arm: {run.seed: run.outcome for run in runs if run.arm == arm} for arm in ARMS}
