"""The race of a search: how many seeds each trial is worth; it follows from results alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate
from innerattn.studies.search.trials import Trial
from innerattn.studies.space import Search

State = Literal["open", "finished", "dropped", "failed"]
LEAST_SEEDS = 2
"""Seeds of a trial without which there is no interval."""

RULES = """\
- **Race.** All trials have the same seeds, in the same order. A trial is dropped when it is worse
  than the best one: the 95 % interval of their difference over the seeds that both have, two or
  more, does not reach 0 (Student's t). The grid without changes, the recipe, is never dropped.
- **Choice.** The best trial is the one with the best mean of those with all seeds. The best of many
  means is too good by chance, so it counts for nothing.
- **Confirmation.** The best trial and the recipe are trained with further seeds. Only these are
  compared."""


@dataclass(frozen=True)
class Standing:
    """How a trial stands.

    Attributes:
        trial: which one.
        scores: of the measure by seed, as far as there are; means over scenarios.
        mean: over these seeds; None without one.
        state: open: it needs further seeds; finished: it has all; dropped: the best one is better;
            failed: a run of it failed or has no value, or its values cannot be run together.
    """

    trial: Trial
    scores: Mapping[int, float]
    mean: Estimate | None
    state: State


def race(
    search: Search,
    seeds: Sequence[int],
    scores: Mapping[Trial, Mapping[int, float]],
    failed: Sequence[Trial],
) -> list[Standing]:
    """How all trials stand.

    Args:
        search: which measure is to be large or small.
        seeds: of the race.
        scores: of every trial by seed, as far as there are.
        failed: those that can have no score.
    """
    sign = 1.0 if search.direction == "maximize" else -1.0
    means = {one.number: seed_estimate(list(own.values())) for one, own in scores.items()}
    out = {one.number for one in failed}
    in_race = [
        (sign * mean.mean, own)
        for one, own in scores.items()
        if len(own) >= LEAST_SEEDS
        and one.number not in out
        and (mean := means[one.number]) is not None
    ]
    best = max(in_race, key=lambda one: one[0])[1] if in_race else {}

    def state(trial: Trial, own: Mapping[int, float]) -> State:
        if trial.number in out:
            return "failed"
        if len(own) == len(seeds):
            return "finished"
        gains = [sign * (own[seed] - best[seed]) for seed in own if seed in best]
        gain = seed_estimate(gains) if len(gains) >= LEAST_SEEDS else None
        return "dropped" if trial.number and gain is not None and gain.high < 0.0 else "open"

    return [Standing(one, own, means[one.number], state(one, own)) for one, own in scores.items()]


def next_seeds(standing: Standing, seeds: Sequence[int]) -> list[int]:
    """The seeds that an open trial needs now: two at first, then one after the other."""
    if standing.state != "open":
        return []
    count = max(LEAST_SEEDS, len(standing.scores) + 1)
    return [seed for seed in seeds[:count] if seed not in standing.scores]


def best_of(search: Search, standings: Sequence[Standing]) -> Standing | None:
    """The best of the finished trials, the first one of several; None if there is none."""
    finished = [one for one in standings if one.state == "finished" and one.mean is not None]
    sign = 1.0 if search.direction == "maximize" else -1.0
    return max(finished, key=lambda one: sign * one.mean.mean if one.mean else 0.0, default=None)
