"""How well the runs of one method do: rescues, score, dispatch and waiting, over runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.evaluate.sharing.dispatch_quality import dispatch_quality
from innerattn.evaluate.sharing.waiting import waiting
from innerattn.evaluate.statistics import Interval
from innerattn.study.over_runs import OverRuns, over_runs
from innerattn.study.run import Measured

COMPETENCE = {
    "rescues_per_episode": "",
    "score": "0 random play, 1 scripted dispatch",
    "sooner": "share of choices",
    "sooner_by_chance": "share of choices",
    "regret_s": "s",
    "regret_by_chance_s": "s",
    "time_to_rescue_s": "s",
    "time_per_rescue_s": "s",
}
"""Figures of competence and their units; rescues and score are of all episodes, the others of
those recorded step by step. See `Summary`, `DispatchQuality` and `Waiting`."""


@dataclass(frozen=True)
class Competence:
    """How well one method does in one situation.

    Attributes:
        situation: of the worlds.
        method: of training.
        seeds: of the runs.
        counts: by run, what the figures are over: score_episodes, episodes, choices, rescued, left.
        each: by run, the figures that `COMPETENCE` names; None where a run has none.
        mean: of each figure over runs.
    """

    situation: str
    method: str
    seeds: tuple[int, ...]
    counts: tuple[dict[str, int], ...]
    each: tuple[dict[str, float | None], ...]
    mean: dict[str, OverRuns | None]


def competence(group: Sequence[Measured]) -> Competence:
    """How well runs of one situation and method do."""
    run = group[0].run
    counts, each = zip(*(_competence_of(measured) for measured in group), strict=True)
    mean = {name: over_runs([figures[name] for figures in each]) for name in COMPETENCE}
    seeds = tuple(measured.run.seed for measured in group)
    return Competence(run.situation, run.method, seeds, counts, each, mean)


def _competence_of(measured: Measured) -> tuple[dict[str, int], dict[str, float | None]]:
    """One run's counts and figures."""
    choice, waited = dispatch_quality(measured.recorded), waiting(measured.recorded)
    counts = {
        "score_episodes": int(measured.summary["score_episodes"]),
        "episodes": measured.recorded.num_episodes,
        "choices": choice.choices,
        "rescued": waited.rescued,
        "left": waited.left,
    }
    score = measured.summary["score"]
    return counts, {
        "rescues_per_episode": float(measured.summary["rescues_per_episode"]["mean"]),
        "score": None if score is None else float(score["mean"]),
        "sooner": _mean(choice.sooner),
        "sooner_by_chance": choice.sooner_by_chance,
        "regret_s": _mean(choice.regret_s),
        "regret_by_chance_s": choice.regret_by_chance_s,
        "time_to_rescue_s": _mean(waited.time_to_rescue_s),
        "time_per_rescue_s": _mean(waited.time_per_rescue_s),
    }


def _mean(interval: Interval | None) -> float | None:
    return None if interval is None else interval.mean
