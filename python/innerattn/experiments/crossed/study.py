"""The crossed design from finished runs, as data: outcomes, effects, answers, what a seed does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.experiments.crossed.arms import ARMS, Arm, arm_of
from innerattn.experiments.crossed.claims import Answer, answers
from innerattn.experiments.crossed.effects import Effect, effects
from innerattn.experiments.crossed.outcome import OUTCOMES, Outcome, outcome_of
from innerattn.experiments.crossed.seed_effect import SeedEffect, seed_effects
from innerattn.experiments.run import Digests, StudyRun, digests, read_measured
from innerattn.experiments.scan import FinishedRun
from innerattn.stats.seeds import SeedEstimate, seed_estimate


@dataclass(frozen=True)
class CrossedRun:
    """A run of the design.

    Attributes:
        arm: how it was trained.
        seed: of its training.
        folder: the run folder.
        digests: what tells it from any other.
        outcome: what it shows.
    """

    arm: Arm
    seed: int
    folder: Path
    digests: Digests
    outcome: Outcome


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
    means: dict[Arm, dict[str, SeedEstimate | None]]
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
        RunError: a run's evaluation is missing or is not one of two food robots.
        ConfigError: a configuration cannot be read.
    """
    names = list(dict.fromkeys(run.case.situation for run in runs))
    return [_situation(name, [run for run in runs if run.case.situation == name]) for name in names]


def _situation(name: str, own: Sequence[FinishedRun]) -> Situation:
    order = {arm: index for index, arm in enumerate(ARMS)}
    found = sorted(map(_run, own), key=lambda run: (order[run.arm], run.seed))
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


def _run(run: FinishedRun) -> CrossedRun:
    case = run.case
    labelled = StudyRun(case.situation, case.method, case.seed, run.folder)
    outcome = outcome_of(read_measured(labelled, step_by_step=False))
    return CrossedRun(arm_of(case), case.seed, run.folder, digests(run.folder), outcome)
