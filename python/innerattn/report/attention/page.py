"""The page on learnt attention, its tables and what its figure draws."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.attention.arms import LEARNT
from innerattn.experiments.attention.study import RULES, AttentionStudy, Comparison
from innerattn.report.learning.page import score_cell
from innerattn.report.plots.arms import ArmDots, ArmPanel
from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.stats.text import format_estimate, format_p, format_seeds

SCORES = "Scores"
COMPARISONS = "Learnt attention minus the rest"
RULED = "Rules"
"""Headings of the page's sections."""


def attention_page(found: AttentionStudy, budget: str, figure: str, left_out: Sequence[str]) -> str:
    """The page.

    Args:
        found: what runs say.
        budget: name of the budget they were trained with.
        figure: file of the figure.
        left_out: what is said of runs that were planned and are not among these.
    """
    parts = ["# What learnt attention is worth\n"]
    if left_out:
        parts += ["**Left out of all results:**\n", *(f"- {one}" for one in left_out), ""]
    count = sum(len(one.seeds) for one in found.learnt)
    parts += [
        f"{count} runs, budget `{budget}`. A score of 0 plays like `random`, a score of 1 like "
        "`hungarian`, in the same worlds.\n",
        f"![Scores of all runs by method and situation]({figure})\n",
    ]
    if found.comparisons:
        parts += [f"## {COMPARISONS}\n", markdown(comparisons_table(found))]
    parts += [f"## {SCORES}\n", markdown(scores_table(found, budget)), f"## {RULED}\n", RULES, ""]
    return "\n".join(parts)


def comparisons_table(found: AttentionStudy) -> Table:
    """Differences, p and verdict by situation and method, at both lengths."""
    numbers = []
    for both in (found.comparisons, found.long_comparisons):
        steps = both[0].episode_steps
        numbers += [f"score, {steps} steps [95 %]", "p (Holm)", f"`{LEARNT}` is"]
    rows = [
        [
            f"{short.situation}, `{LEARNT}` − `{short.other}`",
            format_seeds(short.seeds),
            *_cells(short),
            *_cells(long),
        ]
        for short, long in zip(found.comparisons, found.long_comparisons, strict=True)
    ]
    return plain_table(columns(["", "seeds"], numbers), rows)


def scores_table(found: AttentionStudy, budget: str) -> Table:
    """Scores of every method and situation."""
    steps = found.learnt[0].episode_steps
    heads = [f"score, {length} steps" for length in steps]
    rows = [
        [
            f"`{one.trained}`, {one.situation}",
            format_seeds(one.seeds),
            score_cell(one.score),
            score_cell(one.long_score),
        ]
        for one in found.learnt
    ]
    return plain_table(columns([budget, "seeds"], heads), rows)


def score_panels(found: AttentionStudy) -> list[list[ArmPanel]]:
    """A row for each situation, a panel for each length, with the methods that were run there."""
    rows = []
    for situation in dict.fromkeys(one.situation for one in found.learnt):
        here = [one for one in found.learnt if one.situation == situation]
        panels = []
        for length in (0, 1):
            dots = []
            for one in here:
                values = (one.score, one.long_score)[length]
                known = tuple(x for x in values.each if x is not None)
                mean = values.mean
                bar = None
                if mean is not None and mean.bounded:
                    bar = (mean.mean, mean.low, mean.high)
                dots.append(ArmDots(one.trained, one.trained == LEARNT, known, bar))
            steps = found.learnt[0].episode_steps[length]
            panels.append(ArmPanel(situation, f"score, {steps} steps", tuple(dots), marks=(1.0,)))
        rows.append(panels)
    return rows


def _cells(one: Comparison) -> tuple[str, str, str]:
    difference = None if one.difference is None else one.difference.difference
    return format_estimate(difference), format_p(one.holm_p), one.verdict
