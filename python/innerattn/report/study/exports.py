"""Scores of a study in the forms that rliable and marl-eval read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from innerattn.evaluate.training_score import ScriptedRescues, scripted_rescues
from innerattn.experiments.run import FinishedRun, read_rescues
from innerattn.policies import best_script
from innerattn.records.logged import counts_as_evaluated
from innerattn.studies.aggregates import TASK, Aggregate, algorithm_of
from innerattn.studies.curves import EPISODES
from innerattn.studies.results import Result

ENVIRONMENT = "innerattn"
_MOST_STEPS = 100
"""Lines of a training's log that are exported at most."""


def rliable_document(found: Mapping[str, Aggregate]) -> dict[str, Any]:
    """Matrices of scores, runs by tasks, of the seeds that an algorithm has in all tasks.

    `numpy.array(document["scores"][algorithm])` is what rliable calls the scores of an algorithm.

    Args:
        found: algorithms by name; those that lack a task are left out.
    """
    tasks = list(dict.fromkeys(task for one in found.values() for task in one.scores))
    scores, seeds = {}, {}
    for name, one in found.items():
        if one.scores.keys() == set(tasks):
            shared = sorted(set.intersection(*(set(values) for values in one.scores.values())))
            seeds[name] = shared
            scores[name] = [[one.scores[task][seed] for task in tasks] for seed in shared]
    return {"schema_version": 1, "tasks": tasks, "seeds": seeds, "scores": scores}


def marl_eval_document(found: Mapping[str, Aggregate], results: Sequence[Result]) -> dict[str, Any]:
    """Evaluations by task, algorithm and seed, in the form of marl-eval's raw data.

    Metrics are ``rescues`` per episode and ``score``. Its steps are lines of the training's log,
    whose score is that of the rescues in training between those of the scripts as they were
    measured, or, where training counts them over other episodes, in such worlds;
    ``absolute_metrics`` are those of the evaluation.

    Args:
        found: algorithms by name.
        results: finished runs; those without a score and archived ones are left out.

    Raises:
        RunError: the metrics of a run are missing, altered or damaged.
    """
    names = {tuple(one.algorithm.items()): name for name, one in found.items()}
    tasks: dict[str, Any] = {}
    played: dict[tuple[str, int], ScriptedRescues] = {}
    for one in results:
        name = names.get(tuple(algorithm_of(one).items()))
        run = one.finished
        if name is not None and run is not None and not run.archived:
            task = tasks.setdefault(str(one.run.place[TASK]), {})
            task.setdefault(name, {})[f"seed_{one.run.seed}"] = _of_run(run, played)
    return {ENVIRONMENT: tasks}


def _of_run(run: FinishedRun, played: dict[tuple[str, int], ScriptedRescues]) -> dict[str, Any]:
    """The numbers of one run; scripts that are ``played`` serve all runs of the same worlds."""
    scripts = run.summary["scripted"]
    low, high = (float(scripts[name]["mean"]) for name in ("random", best_script(scripts)))
    config, evaluated = run.config, ScriptedRescues(low, high)
    trained = evaluated
    if not counts_as_evaluated(config):
        worlds = config.training_scenario.model_dump_json(), config.train.seed
        if worlds not in played:
            played[worlds] = scripted_rescues(config, EPISODES)
        trained = played[worlds]

    def metrics(rescues: float, scripts: ScriptedRescues) -> dict[str, list[float]]:
        score = scripts.score(rescues)
        return {"rescues": [rescues]} | ({} if score is None else {"score": [score]})

    logged = [(int(steps), rescues) for steps, rescues in read_rescues(run) if rescues is not None]
    every = max(1, -(-len(logged) // _MOST_STEPS))
    kept = logged[::-1][::every][::-1]  # the last line is among them
    steps = {
        f"step_{number}": {"step_count": env_steps, **metrics(rescues, trained)}
        for number, (env_steps, rescues) in enumerate(kept, 1)
    }
    measured = float(run.summary["rescues_per_episode"]["mean"])
    return {**steps, "absolute_metrics": metrics(measured, evaluated)}
