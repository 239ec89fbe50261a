"""How well the runs of one method do: the score and all measures, over runs.

Scripted policies in the same worlds stand beside them: evenness is no merit by itself, and how good
a dispatch can be depends on the situation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from innerattn.config import Scenario
from innerattn.experiments.paper.workload import rescues_by_task
from innerattn.experiments.run import FinishedRun, OfMethod
from innerattn.measures.registry import MEASURES, measure_of
from innerattn.policies import SCRIPTED
from innerattn.stats import Estimate
from innerattn.stats.seeds import seed_estimate


def competence_units() -> dict[str, str]:
    """The values of competence and their units.

    These are the score, see `innerattn.measures.summary.Performance`, and all `MEASURES` that are
    no counts and apply to the paper's worlds. What needs steps is of the episodes recorded step by
    step, which with scripted policies are all.
    """
    units = {
        name: measure.unit
        for name, measure in MEASURES.items()
        if not measure.is_count and measure.applies(Scenario())
    }
    score = {"score": "0 random play, 1 scripted dispatch"}
    return {"rescues_per_episode": units.pop("rescues_per_episode"), **score, **units}


@dataclass(frozen=True)
class Competence(OfMethod):
    """How well one method does in one situation.

    Attributes:
        counts: by run, what the values are over: score_episodes, episodes, and where these were
            recorded step by step choices, rescued, left.
        each: by run, the values that `competence_units` names; None where a run has none.
        mean: of each value over runs.
    """

    counts: tuple[dict[str, int], ...]
    each: tuple[dict[str, float | None], ...]
    mean: dict[str, Estimate | None]


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
    mean = {name: seed_estimate([values[name] for values in each]) for name in competence_units()}
    seeds = tuple(run.seed for run in group)
    return Competence(group[0].case.worlds, method, seeds, counts, each, mean)


def _of_run(run: FinishedRun) -> tuple[dict[str, int], dict[str, float | None]]:
    """One run's counts and values.

    Raises:
        RunError: a task is not one that two robots share.
    """
    rescues_by_task(run)
    score, rescues = run.summary["score"], float(run.summary["rescues_per_episode"]["mean"])
    stored = {"rescues_per_episode": rescues, **_stored(run, run.method)}
    values = {
        name: stored[name] if name in stored else _mean(measure_of(name, *run.scored))
        for name in MEASURES
    }
    values["score"] = None if score is None else float(score["mean"])
    return _joined(run, run.recorded.num_episodes, values)


def _of_script(name: str, run: FinishedRun) -> tuple[dict[str, int], dict[str, float | None]]:
    """A script's counts and values in the worlds of a run."""
    mean = {other: float(of["mean"]) for other, of in run.summary["scripted"].items()}
    least, span = mean["random"], mean["hungarian"] - mean["random"]
    score = (mean[name] - least) / span if run.summary["score"] else None
    episodes = int(run.summary["score_episodes"])
    return _joined(run, episodes, {**_stored(run, name), "score": score})


def _joined(
    run: FinishedRun, episodes: int, values: dict[str, float | None]
) -> tuple[dict[str, int], dict[str, float | None]]:
    """Counts and values; what was not measured is None."""
    counts = {"score_episodes": int(run.summary["score_episodes"]), "episodes": episodes}
    counted = [name for name, measure in MEASURES.items() if measure.is_count]
    counts |= {name: int(value) for name in counted if (value := values.get(name)) is not None}
    return counts, {name: values.get(name) for name in competence_units()}


def _stored(run: FinishedRun, policy: str) -> dict[str, float | None]:
    """What a run's evaluation stored of a policy's measures at the standard length."""
    stored = run.summary.get("measures", {}).get(policy, {})
    return {
        name: float(value["mean"]) if isinstance(value, dict) else value
        for name, value in stored.items()
    }


def _mean(value: Estimate | float | int | None) -> float | None:
    return value.mean if isinstance(value, Estimate) else value
