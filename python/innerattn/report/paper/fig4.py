"""Fig. 4: the entropy of attention during training as a table, as CSV, and as what is drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence

from innerattn.experiments.paper.fig4 import EntropyCourse
from innerattn.report.table import Table, columns, csv_text, plain_table
from innerattn.stats.seeds import SeedCurve
from innerattn.stats.text import NONE, format_estimate


def entropy_table(courses: Sequence[EntropyCourse]) -> Table:
    """How selective attention begins and ends; attention that never chooses is left out."""
    numbers = ["first tenth [nats]", "last tenth [nats]", "change [nats]", "last tenth / ln(N − 1)"]
    heads = columns(["situation", "method"], numbers)
    rows = []
    for course in courses:
        if course.chooses:
            even = course.even_nats
            cells = [
                format_estimate(course.begin),
                format_estimate(course.end),
                format_estimate(course.change),
            ]
            cells += [f"{course.end.mean / even:.2f}" if even else NONE]
            rows.append([course.situation, course.method, *cells])
    return plain_table(heads, rows)


def logged(courses: Sequence[EntropyCourse]) -> str:
    """From when to when the entropy was logged."""
    ends = {(int(course.env_steps[0]), int(course.env_steps[-1])) for course in courses}
    return " or ".join(f"{first:,} to {last:,}" for first, last in sorted(ends))


def fig4_csv(courses: Sequence[EntropyCourse]) -> str:
    """One line per situation, method, time and robot, and one for all robots."""
    lines = []
    for course in courses:
        mean, by_robot = course.mean(), course.by_robot()
        for t, env_steps in enumerate(course.env_steps.tolist()):
            rows: list[tuple[str, SeedCurve, tuple[int, ...]]] = [("all", mean, (t,))]
            rows += [(robot, by_robot, (t, r)) for r, robot in enumerate(course.robots)]
            for robot, found, at in rows:
                ends = [float(found.mean[at]), float(found.low[at]), float(found.high[at])]
                known = [None if math.isnan(end) else end for end in ends]
                own = [course.situation, course.method, env_steps, robot, int(found.runs[at])]
                lines.append([*own, *known, found.band])
    heads = ["situation", "method", "env_steps", "robot", "runs", "mean_nats", "low", "high"]
    return csv_text([*heads, "band"], lines)
