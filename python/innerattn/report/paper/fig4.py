"""Fig. 4 as a CSV file and as the lines of a plot."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence

import numpy as np

from innerattn.experiments.paper.fig4 import EntropyCourse
from innerattn.report.plots.entropy import EntropyLines
from innerattn.stats.seeds import BAND_NAMES, SeedCurve


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
            rows: list[tuple[str, SeedCurve, tuple[int, ...]]] = [("all", mean, (t,))]
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
