"""Fig. 4 over many runs: the entropy of attention during training, from the runs' own metrics.

The paper does not say which situation and method its figure is about, nor whether a line is one
run's; here every situation and method has its own courses, with a band over runs.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import RunError
from innerattn.report.entropy_figure import EntropyLines
from innerattn.study.over_runs import BAND_NAMES, Array, Band, OverRuns, band, over_runs
from innerattn.study.run import StudyRun, by_method

SCHEMA_VERSION = 1

PRINTED_NATS = 1.02
"""What the paper says that all heads' entropy falls to."""

_EVEN_WITHIN_NATS = 1e-6
_PART = 10  # begin and end are the first and the last tenth of the lines of metrics


@dataclass(frozen=True)
class EntropyCourse:
    """The entropy of attention in runs of one situation and method.

    Attributes:
        situation: of the worlds.
        method: of training.
        seeds: N of them.
        robots: R names.
        env_steps: (T,) int64 at which all runs were logged [env-steps].
        nats: (N, T, R, H) float64 entropy by run, time, robot and head.
        begin: mean over robots, heads and the first tenth of the times.
        end: the same of the last tenth.
        change: end minus begin.
    """

    situation: str
    method: str
    seeds: tuple[int, ...]
    robots: tuple[str, ...]
    env_steps: NDArray[np.int64]
    nats: Array
    begin: OverRuns
    end: OverRuns
    change: OverRuns

    @property
    def even_nats(self) -> float:
        """ln(R - 1), the entropy of even attention."""
        return math.log(len(self.robots) - 1)

    @property
    def chooses(self) -> bool:
        """Whether attention is ever uneven; it never is where its weights are fixed."""
        return bool((np.abs(self.nats - self.even_nats) > _EVEN_WITHIN_NATS).any())

    def mean(self) -> Band:
        """Over robots and heads, (T,)."""
        return band(self.nats.mean((2, 3)))

    def by_robot(self) -> Band:
        """Over heads, (T, R)."""
        return band(self.nats.mean(3))

    def by_head(self) -> Array:
        """Mean over runs, (T, R, H)."""
        return np.asarray(self.nats.mean(0))

    def to_json(self) -> dict[str, Any]:
        """As a JSON object."""
        return {
            **{name: getattr(self, name) for name in ("situation", "method", "seeds", "robots")},
            "even_nats": self.even_nats,
            "env_steps": self.env_steps.tolist(),
            "nats_by_seed_time_robot_head": self.nats.tolist(),
            "mean": self.mean().to_json(),
            "by_robot": self.by_robot().to_json(),
            **{name: asdict(getattr(self, name)) for name in ("begin", "end", "change")},
        }


def fig4(runs: Sequence[StudyRun]) -> list[EntropyCourse]:
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
    return {
        "schema_version": SCHEMA_VERSION,
        "printed_nats": PRINTED_NATS,
        "courses": [course.to_json() for course in courses],
    }


def fig4_csv(courses: Sequence[EntropyCourse]) -> str:
    """One line per situation, method, time and robot, and one for all robots."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        ["situation", "method", "env_steps", "robot", "runs", "mean_nats", "low", "high", "band"]
    )
    for course in courses:
        mean, by_robot = course.mean(), course.by_robot()
        for t, env_steps in enumerate(course.env_steps.tolist()):
            rows: list[tuple[str, Band, tuple[int, ...]]] = [("all", mean, (t,))]
            rows += [(robot, by_robot, (t, r)) for r, robot in enumerate(course.robots)]
            for robot, found, at in rows:
                ends = [float(found.mean[at]), float(found.low[at]), float(found.high[at])]
                shown = ["" if math.isnan(end) else end for end in ends]
                own = [course.situation, course.method, env_steps, robot, int(found.runs[at])]
                writer.writerow([*own, *shown, found.kind])
    return text.getvalue()


def fig4_lines(courses: Sequence[EntropyCourse]) -> list[EntropyLines]:
    """What is drawn: courses of attention that chooses."""
    lines = []
    for course in courses:
        if not course.chooses:
            continue
        mean, by_robot, count = course.mean(), course.by_robot(), len(course.seeds)
        runs = "1 run" if count == 1 else f"{count} runs, {BAND_NAMES[mean.kind]}"
        lines.append(
            EntropyLines(
                situation=course.situation,
                method=course.method,
                label=f"{course.method} ({runs})",
                env_steps=course.env_steps,
                mean=np.stack([mean.mean, mean.low, mean.high]),
                robots=course.robots,
                by_robot=np.stack([by_robot.mean, by_robot.low, by_robot.high]),
                by_head=course.by_head(),
                even_nats=course.even_nats,
            )
        )
    return lines


def _course(group: Sequence[StudyRun]) -> EntropyCourse | None:
    tables = [_entropies(run) for run in group]
    if not all(tables):
        return None
    times = sorted(set.intersection(*(set(table) for table in tables)))
    if not times:
        raise RunError(f"{group[0].folder} and others: were never logged at the same env_steps")
    robots = tuple(tables[0][times[0]])
    nats = np.array([[list(table[t].values()) for t in times] for table in tables], np.float64)
    part = max(1, len(times) // _PART)
    overall = nats.mean((2, 3))
    begin, end = overall[:, :part].mean(1), overall[:, -part:].mean(1)
    figures = [over_runs(values.tolist()) for values in (begin, end, end - begin)]
    first, last, change = (figure for figure in figures if figure is not None)
    return EntropyCourse(
        situation=group[0].situation,
        method=group[0].method,
        seeds=tuple(run.seed for run in group),
        robots=robots,
        env_steps=np.array(times, np.int64),
        nats=nats,
        begin=first,
        end=last,
        change=change,
    )


def _entropies(run: StudyRun) -> dict[int, dict[str, list[float]]]:
    """Entropy by env-steps, robot and head; empty where the method has none."""
    path = run.folder / "metrics.jsonl"
    try:
        lines = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
        found = {int(line["env_steps"]): dict(line["attention_entropy"]) for line in lines}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path}: not the metrics of a run") from error
    if not found:
        raise RunError(f"{path}: holds no line")
    return {steps: entropy for steps, entropy in found.items() if entropy}
