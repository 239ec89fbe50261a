"""How well the runs of one method do: rescues, score, dispatch and waiting, over runs.

Scripted policies in the same worlds stand beside them: evenness is no merit by itself, and how good
a dispatch can be depends on the situation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from innerattn.evaluate.play import run_episodes
from innerattn.experiments.paper.workload import workload_imbalance
from innerattn.experiments.run import Measured
from innerattn.measures.dispatch_quality import dispatch_quality
from innerattn.measures.waiting import waiting
from innerattn.policies import SCRIPTED, scripted_policy
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate

COMPETENCE = {
    "rescues_per_episode": "",
    "score": "0 random play, 1 scripted dispatch",
    "imbalance": "distance of a share from 0.5",
    "sooner": "share of choices",
    "sooner_by_chance": "share of choices",
    "regret_s": "s",
    "regret_by_chance_s": "s",
    "time_to_rescue_s": "s",
    "time_per_rescue_s": "s",
}
"""Figures of competence and their units; the first three are of all episodes, the others of those
recorded step by step, which with scripted policies are all, too. See `Summary`, `imbalance`,
`DispatchQuality` and `Waiting`."""

_STEPS = ("positions", "velocities", "victims")


@dataclass(frozen=True)
class Competence:
    """How well one method does in one situation.

    Attributes:
        situation: of the worlds.
        method: of training, or a scripted policy.
        seeds: of the runs; a scripted policy has those of the runs in whose worlds it was played.
        counts: by run, what the figures are over: score_episodes, episodes, and where these were
            recorded step by step choices, rescued, left.
        each: by run, the figures that `COMPETENCE` names; None where a run has none.
        mean: of each figure over runs.
    """

    situation: str
    method: str
    seeds: tuple[int, ...]
    counts: tuple[dict[str, int], ...]
    each: tuple[dict[str, float | None], ...]
    mean: dict[str, Estimate | None]


def competence(group: Sequence[Measured]) -> Competence:
    """How well runs of one situation and method do."""
    run = group[0].run
    counts, each = zip(*(_competence_of(measured) for measured in group), strict=True)
    mean = {name: seed_estimate([figures[name] for figures in each]) for name in COMPETENCE}
    seeds = tuple(measured.run.seed for measured in group)
    return Competence(run.situation, run.method, seeds, counts, each, mean)


def scripted_competence(group: Sequence[Measured]) -> list[Competence]:
    """How well the scripted policies do in the worlds of some runs; they are played here."""
    return [competence([_played(name, measured) for measured in group]) for name in SCRIPTED]


def _played(name: str, measured: Measured) -> Measured:
    """What a run's evaluation would have recorded of a scripted policy instead."""
    own, summary = measured.recorded, measured.summary
    policy = scripted_policy(name, own.scenario, own.seed)
    count = sum(part.num_episodes for part in measured.scored)
    recorded = run_episodes(policy, own.scenario, count, own.seed, record=_STEPS)
    mean = {other: float(of["mean"]) for other, of in summary["scripted"].items()}
    least, span = mean["random"], mean["hungarian"] - mean["random"]
    return Measured(
        replace(measured.run, method=name),
        recorded,
        (recorded,),
        {
            "score_episodes": summary["score_episodes"],
            "rescues_per_episode": summary["scripted"][name],
            "score": {"mean": (mean[name] - least) / span} if summary["score"] else None,
        },
    )


def _competence_of(measured: Measured) -> tuple[dict[str, int], dict[str, float | None]]:
    """One run's counts and figures."""
    score = measured.summary["score"]
    counts = {
        "score_episodes": int(measured.summary["score_episodes"]),
        "episodes": measured.recorded.num_episodes,
    }
    figures: dict[str, float | None] = dict.fromkeys(COMPETENCE)
    figures |= {
        "rescues_per_episode": float(measured.summary["rescues_per_episode"]["mean"]),
        "score": None if score is None else float(score["mean"]),
        "imbalance": workload_imbalance(measured),
    }
    if not measured.recorded.steps:  # a small copy of a run
        return counts, figures
    choice, waited = dispatch_quality(measured.recorded), waiting(measured.recorded)
    counts |= {"choices": choice.choices, "rescued": waited.rescued, "left": waited.left}
    return counts, figures | {
        "sooner": _mean(choice.sooner),
        "sooner_by_chance": choice.sooner_by_chance,
        "regret_s": _mean(choice.regret_s),
        "regret_by_chance_s": choice.regret_by_chance_s,
        "time_to_rescue_s": _mean(waited.time_to_rescue_s),
        "time_per_rescue_s": _mean(waited.time_per_rescue_s),
    }


def _mean(interval: Estimate | None) -> float | None:
    return None if interval is None else interval.mean
