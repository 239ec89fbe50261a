"""The page on what each choice of the recipe is worth, from finished runs, as files in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.experiments.learning.ablations import MARGIN, Ablations, read_ablations
from innerattn.experiments.run import FinishedRun
from innerattn.report.folder import ReportFolder, listed_runs
from innerattn.report.learning.page import score_cell
from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.stats.comparison import Contrast
from innerattn.stats.estimate import as_json
from innerattn.stats.text import NONE, format_estimate, format_seeds

SCHEMA_VERSION = 1
FILES = ("learning_ablations.json", "learning_ablations.md")
"""What `write_ablations` writes."""
DIFFERENCES = "The recipe with one change"
"""Heading of the table."""


def write_ablations(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str] = ()
) -> Ablations:
    """Write `FILES` into ``out``; the same runs give the same bytes.

    Args:
        runs: finished runs, at least one; they are read only.
        out: folder of the study; the runs' folders are named from there.
        budget: name of the budget they were trained with.
        left_out: what is said of runs that were planned and are not among ``runs``.

    Returns:
        What the report says.

    Raises:
        RunError: runs cannot be compared.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    found = read_ablations(runs)
    folder = ReportFolder(out, budget)
    document = {
        "schema_version": SCHEMA_VERSION,
        "budget": budget,
        "margin": MARGIN,
        "recipe": as_json(found.recipe),
        "ablated": as_json(found.ablated),
        "runs": listed_runs(runs, out),
    }
    json_file, page = FILES
    folder.json(json_file, document)
    folder.markdown(page, ablations_page(found, budget, left_out))
    return found


def ablations_page(found: Ablations, budget: str, left_out: Sequence[str]) -> str:
    """The page."""
    parts = ["# What each choice of the recipe is worth\n"]
    if left_out:
        parts += ["**Left out of all results:**\n", *(f"- {one}" for one in left_out), ""]
    parts += [f"## {DIFFERENCES}\n", markdown(ablations_table(found, budget)), ""]
    return "\n".join(parts)


def ablations_table(found: Ablations, budget: str) -> Table:
    """A row for the recipe, and one for each change; by situation."""
    learnt = [*found.recipe, *(one.learnt for one in found.ablated)]
    standard, long = learnt[0].episode_steps
    seeds = format_seeds(sorted({seed for one in learnt for seed in one.seeds}))
    heads = [
        f"score, {standard} steps",
        "difference [95 %]",
        f"score, {long} steps",
        "difference [95 %]",
    ]
    situations = list(dict.fromkeys(one.situation for one in learnt))
    rows = []
    for situation in situations:
        name = f" in {situation}" if len(situations) > 1 else ""
        for one in found.recipe:
            if one.situation == situation:
                scores = score_cell(one.score), "", score_cell(one.long_score), ""
                rows.append([f"the recipe{name}", "", *scores])
        for changed in found.ablated:
            if changed.learnt.situation == situation:
                cells = (
                    score_cell(changed.learnt.score),
                    _difference(changed.score),
                    score_cell(changed.learnt.long_score),
                    _difference(changed.long_score),
                )
                rows.append([changed.ablation.choice, changed.ablation.instead, *cells])
    first = f"{budget}, {', '.join(situations)}, seeds {seeds}"
    return plain_table(columns([first, "instead"], heads), rows)


def _difference(found: Contrast | None) -> str:
    """The difference, in bold where its interval lies on one side of 0."""
    if found is None:
        return NONE
    mean, text = found.difference, format_estimate(found.difference)
    if mean.low <= 0.0 <= mean.high:
        return text
    number, _, interval = text.partition(" ")
    return f"**{number}** {interval}"
