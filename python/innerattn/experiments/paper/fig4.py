"""Fig. 4 over many runs: the entropy of attention during training, from the runs' own metrics.

The paper does not say which situation and method its figure is about, nor whether a line is one
run's; here every situation and method has its own courses, with a band over runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import RunError
from innerattn.experiments.run import FinishedRun, OfMethod, by_method, read_metrics
from innerattn.stats import Estimate
from innerattn.stats.estimate import as_json
from innerattn.stats.seeds import Array, SeedCurve, seed_curve, seed_estimate

SCHEMA_VERSION = 1

PRINTED_NATS = 1.02
"""What the paper says that all heads' entropy falls to."""

_EVEN_WITHIN_NATS = 1e-6
_PART = 10  # begin and end are the first and the last tenth of the lines of metrics


@dataclass(frozen=True)
class EntropyCourse(OfMethod):
    """The entropy of attention in runs of one situation and method, with N seeds.

    Attributes:
        robots: R names.
        kinds: of the R robots.
        env_steps: (T,) int64 at which all runs were logged [env-steps].
        nats: (N, T, R, H) float64 entropy by run, time, robot and head.
        begin: mean over robots, heads and the first tenth of the times.
        end: the same of the last tenth.
        change: end minus begin.
    """

    robots: tuple[str, ...]
    kinds: tuple[str, ...]
    env_steps: NDArray[np.int64]
    nats: Array
    begin: Estimate
    end: Estimate
    change: Estimate

    @property
    def even_nats(self) -> float:
        """ln(R - 1), the entropy of even attention."""
        return math.log(len(self.robots) - 1)

    @property
    def chooses(self) -> bool:
        """Whether attention is ever uneven; it never is where its weights are fixed."""
        return bool((np.abs(self.nats - self.even_nats) > _EVEN_WITHIN_NATS).any())

    def mean(self) -> SeedCurve:
        """Over robots and heads, (T,)."""
        return seed_curve(self.nats.mean((2, 3)))

    def by_robot(self) -> SeedCurve:
        """Over heads, (T, R)."""
        return seed_curve(self.nats.mean(3))

    def end_by_head(self) -> Array:
        """Of every run, robot and head by itself, mean over the last tenth of the times, (N, R, H).

        Heads have no order that is the same in two runs, so that a mean over runs says nothing.
        """
        return np.asarray(self.nats[:, -_part(len(self.env_steps)) :].mean(1))


def fig4(runs: Sequence[FinishedRun]) -> list[EntropyCourse]:
    """Entropy courses of all methods with attention.

    Returns:
        By situation and method; methods whose metrics hold no entropy are left out.

    Raises:
        RunError: a run has no readable metrics, or runs of one method were never logged at the same
            time.
    """
    courses = (_course(group) for group in by_method(runs).values())
    return [course for course in courses if course is not None]


def fig4_json(courses: Sequence[EntropyCourse]) -> dict[str, Any]:
    """The document of ``fig4.json``."""
    names = ("situation", "method", "seeds", "robots", "even_nats", "env_steps")
    told = [
        {
            **{name: getattr(course, name) for name in (*names, "begin", "end", "change")},
            "nats_by_seed_time_robot_head": course.nats,
            "mean": course.mean(),
            "by_robot": course.by_robot(),
        }
        for course in courses
    ]
    document: dict[str, Any] = as_json({"printed_nats": PRINTED_NATS, "courses": told})
    return {"schema_version": SCHEMA_VERSION, **document}


def _course(group: Sequence[FinishedRun]) -> EntropyCourse | None:
    tables = [_entropies(run) for run in group]
    if not all(tables):
        return None
    times = sorted(set.intersection(*(set(table) for table in tables)))
    if not times:
        raise RunError(f"{group[0].folder} and others: were never logged at the same env_steps")
    robots = tuple(tables[0][times[0]])
    nats = np.array([[list(table[t].values()) for t in times] for table in tables], np.float64)
    part = _part(len(times))
    overall = nats.mean((2, 3))
    begin, end = overall[:, :part].mean(1), overall[:, -part:].mean(1)
    estimates = [seed_estimate(values.tolist()) for values in (begin, end, end - begin)]
    first, last, change = (one for one in estimates if one is not None)
    return EntropyCourse(
        situation=group[0].situation,
        method=group[0].method,
        seeds=tuple(run.seed for run in group),
        robots=robots,
        kinds=tuple(robot.kind for robot in group[0].config.scenario.robots),
        env_steps=np.array(times, np.int64),
        nats=nats,
        begin=first,
        end=last,
        change=change,
    )


def _part(times: int) -> int:
    """How many times the beginning and the end are."""
    return max(1, times // _PART)


def _entropies(run: FinishedRun) -> dict[int, dict[str, list[float]]]:
    """Entropy by env-steps, robot and head; empty where the method has none."""
    found = read_metrics(run, "env_steps", "attention_entropy")
    return {int(steps): dict(entropy) for steps, entropy in found if entropy}
