"""How well the runs of one method do: rescues, score, dispatch and waiting, over runs.

Scripted policies in the same worlds stand beside them: evenness is no merit by itself, and how good
a dispatch can be depends on the situation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.experiments.paper.workload import workload_imbalance
from innerattn.experiments.run import FinishedRun
from innerattn.policies import SCRIPTED
from innerattn.stats.seeds import SeedEstimate, seed_estimate

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

_COUNTS = ("choices", "rescued", "left")


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
    mean: dict[str, SeedEstimate | None]


def competence(group: Sequence[FinishedRun]) -> Competence:
    """How well runs of one situation and method do."""
    counts, each = zip(*(_of_run(run) for run in group), strict=True)
    return _over_runs(group, group[0].method, counts, each)


def scripted_competence(group: Sequence[FinishedRun]) -> list[Competence]:
    """How well the scripted policies do in the worlds of some runs, as their evaluations found.

    Evaluations that are older than these measures say nothing of scripts; they are left out.
    """
    known = [run for run in group if SCRIPTED[0] in run.summary.get("measures", {})]
    found = []
    for name in SCRIPTED if known else ():
        counts, each = zip(*(_of_script(name, run) for run in known), strict=True)
        found.append(_over_runs(known, name, counts, each))
    return found


def _over_runs(
    group: Sequence[FinishedRun],
    method: str,
    counts: tuple[dict[str, int], ...],
    each: tuple[dict[str, float | None], ...],
) -> Competence:
    mean = {name: seed_estimate([values[name] for values in each]) for name in COMPETENCE}
    seeds = tuple(run.seed for run in group)
    return Competence(group[0].situation, method, seeds, counts, each, mean)


def _of_run(run: FinishedRun) -> tuple[dict[str, int], dict[str, float | None]]:
    """One run's counts and values."""
    score = run.summary["score"]
    return _joined(
        run,
        run.method,
        rescues_per_episode=float(run.summary["rescues_per_episode"]["mean"]),
        score=None if score is None else float(score["mean"]),
        imbalance=workload_imbalance(run),
    )


def _of_script(name: str, run: FinishedRun) -> tuple[dict[str, int], dict[str, float | None]]:
    """A script's counts and values in the worlds of a run."""
    mean = {other: float(of["mean"]) for other, of in run.summary["scripted"].items()}
    least, span = mean["random"], mean["hungarian"] - mean["random"]
    return _joined(
        run,
        name,
        rescues_per_episode=mean[name],
        score=(mean[name] - least) / span if run.summary["score"] else None,
        imbalance=run.summary["measures"][name]["imbalance"],
    )


def _joined(
    run: FinishedRun, policy: str, **values: float | None
) -> tuple[dict[str, int], dict[str, float | None]]:
    """Counts and values of a policy; what its evaluation did not measure is None."""
    measured = run.summary.get("measures", {}).get(policy, {})
    counts = {"score_episodes": int(run.summary["score_episodes"])}
    counts["episodes"] = int(measured.get("episodes", run.recorded.num_episodes))
    counts |= {name: int(measured[name]) for name in _COUNTS if name in measured}
    return counts, {name: measured.get(name) for name in COMPETENCE} | values
