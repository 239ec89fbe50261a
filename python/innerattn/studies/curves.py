"""Courses of training from the metrics of finished runs: rescues against env-steps and time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from innerattn.evaluate.training_score import training_rescues
from innerattn.experiments.run import FinishedRun, read_metrics, read_rescues
from innerattn.records.logged import counts_as_evaluated, unit_of_rescues
from innerattn.stats.seeds import SeedCurve, seed_curve

Array = NDArray[np.float64]

PARTS = 40
"""Points of a curve at most: means over so many equal parts of a run."""
SCRIPTS = ("hungarian", "greedy")
"""The scripted policies that a curve is shown beside."""
EPISODES = 500
"""Episodes of each script that are played where no evaluation counts rescues alike."""


@dataclass(frozen=True)
class LearningCurve:
    """The course of one method in one situation.

    Attributes:
        situation: of the worlds.
        method: what was trained, by name.
        env_steps: (P,) in the middle of each part.
        seconds: (P,) of training until then, with what compiling took; means over runs.
        rescues: (P,) as `logged_rescues` counts them, over runs; NaN where no episode ended.
        unit: what they are counted over, see `unit_of_rescues`.
        scripts: rescues of `SCRIPTS` by name, counted alike: in the worlds of the evaluation of the
            situation's first run, or in worlds as those it trained in.
    """

    situation: str
    method: str
    env_steps: Array
    seconds: Array
    rescues: SeedCurve
    unit: str
    scripts: dict[str, float]


def learning_curves(
    groups: Iterable[tuple[str, str, Sequence[FinishedRun]]],
) -> list[LearningCurve]:
    """The courses of groups of runs; a group with a run in which no episode ended has none.

    Args:
        groups: situation, name of the method, and a run for each seed.

    Raises:
        RunError: a run has no readable metrics.
    """
    scripts: dict[str, dict[str, float]] = {}
    curves = (_curve(*group, scripts) for group in groups)
    return [curve for curve in curves if curve is not None]


def _curve(
    situation: str,
    method: str,
    group: Sequence[FinishedRun],
    scripts: dict[str, dict[str, float]],
) -> LearningCurve | None:
    courses = [_course(run) for run in group]
    if not all(len(steps) for steps, _ in courses):
        return None
    end = min(steps[-1] for steps, _ in courses)
    # Parts are longer than the time between two lines of metrics, so that none is without one.
    fewest = min(len(steps) for steps, _ in courses)
    parts = max(1, min(PARTS, 2 * fewest // 3))
    edges = np.linspace(0.0, end, parts + 1)
    middles = (edges[1:] + edges[:-1]) / 2.0
    if situation not in scripts:  # they play once for all methods
        scripts[situation] = _scripts(group[0])
    return LearningCurve(
        situation=situation,
        method=method,
        env_steps=middles,
        seconds=np.mean([_seconds_at(run, middles) for run in group], axis=0),
        rescues=seed_curve(np.stack([in_parts(steps, values, edges) for steps, values in courses])),
        unit=unit_of_rescues(group[0].config),
        scripts=scripts[situation],
    )


def _scripts(run: FinishedRun) -> dict[str, float]:
    config = run.config
    if not counts_as_evaluated(config):
        return {name: training_rescues(config, name, EPISODES, None) for name in SCRIPTS}
    scripted = run.summary["scripted"]
    return {name: float(scripted[name]["mean"]) for name in SCRIPTS if name in scripted}


def in_parts(steps: Array, values: Array, edges: Array) -> Array:
    """Means over the parts between the edges.

    A value on an edge belongs to the part before it; what lies after the last edge, to the last.

    Args:
        steps: (T,) times.
        values: (T,) at these.
        edges: (P + 1,) rising, from at most the first of ``steps``.

    Returns:
        (P,); NaN where a part has no value.
    """
    parts = len(edges) - 1
    part = np.clip(np.searchsorted(edges, steps) - 1, 0, parts - 1)
    count = np.bincount(part, minlength=parts)
    total = np.bincount(part, values, parts)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _course(run: FinishedRun) -> tuple[Array, Array]:
    """Env-steps and rescues, of the times at which episodes had ended."""
    found = [both for both in read_rescues(run) if both[1] is not None]
    known = np.array(found, np.float64).reshape(-1, 2)
    return known[:, 0], known[:, 1]


def _seconds_at(run: FinishedRun, env_steps: Array) -> Array:
    """Seconds of training until then, by linear interpolation between lines of metrics."""
    found = np.array([(0.0, 0.0), *read_metrics(run, "env_steps", "seconds")], np.float64)
    return np.interp(env_steps, found[:, 0], found[:, 1])
