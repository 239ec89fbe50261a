"""The page on what methods learn, its tables and what its figure draws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from innerattn.experiments.learning.curves import EPISODES
from innerattn.experiments.learning.study import BySeed, Learning
from innerattn.report.plots.curves import CurveLine
from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.stats.comparison import Contrast
from innerattn.stats.text import NONE, format_estimate, format_number, format_seeds

SCORES = "Scores"
ATTENTION = "Inner beside uniform attention"
CURVES = "Learning curves"
"""Headings of the page's sections."""


def learning_page(found: Learning, budget: str, figure: str | None, left_out: Sequence[str]) -> str:
    """The page.

    Args:
        found: what runs have learnt.
        budget: name of the budget they were trained with.
        figure: file of the learning curves; None where there is none.
        left_out: what is said of runs that were planned and are not among these.
    """
    parts = ["# What is learnt\n"]
    if left_out:
        parts += ["**Left out of all results:**\n", *(f"- {one}" for one in left_out), ""]
    count = sum(len(one.seeds) for one in found.learnt)
    parts += [
        f"{count} runs, budget `{budget}`. A score of 0 plays like `random`, a score of 1 like "
        "`hungarian`, in the same worlds. Bold are means over seeds, with half the 95 % interval "
        "(Student's t); in brackets are the values of each seed. *Alike*: two one-sided tests at "
        f"5 % put the difference, one per seed, within {found.margin:g}.\n",
        f"## {SCORES}\n",
        markdown(scores_table(found, budget)),
    ]
    if found.differences:
        parts += [f"## {ATTENTION}\n", markdown(attention_table(found))]
    if figure is not None:
        parts += [
            f"## {CURVES}\n",
            f"![Rescues per training episode against env-steps and time]({figure})\n",
            "Curves are training episodes with sampled actions: means over seeds with 95 % "
            "intervals (Student's t), of two seeds the range. Minutes are means over seeds. Dotted "
            "lines are scripts in episodes as long as those of training: in the worlds of the "
            f"evaluation, or, where its episodes have another length, in {EPISODES} episodes in "
            "worlds as those of the training.\n",
        ]
    return "\n".join(parts)


def scores_table(found: Learning, budget: str) -> Table:
    """Rescues and scores of every method and situation."""
    seeds = sorted({seed for one in found.learnt for seed in one.seeds})
    standard, long = found.learnt[0].episode_steps
    first = f"{budget}, seed{'s' if len(seeds) > 1 else ''} {format_seeds(seeds)}"
    numbers = [f"rescues, {standard} steps", f"score, {standard} steps", f"score, {long} steps"]
    rows = [
        [
            f"{one.trained}, {one.situation}",
            *map(score_cell, (one.rescues, one.score, one.long_score)),
        ]
        for one in found.learnt
    ]
    return plain_table(columns([first], numbers), rows)


def attention_table(found: Learning) -> Table:
    """Scores with inner minus those with uniform attention, seed by seed."""
    numbers = []
    for steps in found.learnt[0].episode_steps:
        numbers += [f"score, {steps} steps [95 %]", f"alike within {found.margin:g}?"]
    rows = [
        [f"{one.algorithm}, {one.situation}", *_compared(one.score), *_compared(one.long_score)]
        for one in found.differences
    ]
    return plain_table(columns(["inner − uniform attention"], numbers), rows)


def curve_lines(found: Learning) -> list[CurveLine]:
    """What the figure draws."""
    return [
        CurveLine(
            curve.situation,
            curve.method,
            curve.env_steps,
            curve.seconds,
            np.stack([curve.rescues.mean, curve.rescues.low, curve.rescues.high]),
            curve.scripts,
        )
        for curve in found.curves
    ]


def score_cell(values: BySeed) -> str:
    """The mean over seeds with half its interval, and the value of each seed."""
    mean = values.mean
    if mean is None:
        return NONE
    each = ", ".join(NONE if value is None else format_number(value) for value in values.each)
    half = f" ± {format_number((mean.high - mean.low) / 2)}" if mean.bounded else ""
    return f"**{format_number(mean.mean)}**{half} ({each})"


def _compared(found: Contrast | None) -> tuple[str, str]:
    if found is None:
        return NONE, NONE
    return format_estimate(found.difference), "yes" if found.equivalent else "not shown"
