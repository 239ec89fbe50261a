"""The page on the crossed design, and the long tables beside it, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.crossed.claims import RULES
from innerattn.experiments.crossed.outcome import IDLE
from innerattn.experiments.crossed.study import Situation
from innerattn.report.crossed.tables import (
    LAMBDA,
    arms_table,
    claims_table,
    effects_table,
    seeds_table,
)
from innerattn.report.folder import left_out_list
from innerattn.report.table import markdown
from innerattn.stats.text import format_estimate, format_seeds

TITLE = "# What makes the food robots share evenly?\n"


def crossed_page(situations: Sequence[Situation], budget: str, left_out: Sequence[str]) -> str:
    """The page: the figure of seeds, claims, rules, and where the rest is."""
    seeds = sorted({run.seed for situation in situations for run in situation.runs})
    count = sum(len(situation.runs) for situation in situations)
    parts = [
        TITLE,
        *left_out_list(left_out),
        "![Share of the first food robot, by seed](crossed_seeds.png)\n",
        f"{count} runs, budget `{budget}`, seeds {format_seeds(seeds)}. A dot is a run whose "
        f"robots have parameters of their own; a bar spans the runs of a seed. "
        f"{_correlations(situations)} {LAMBDA}\n",
        "## Claims\n",
        markdown(claims_table(situations)),
        "Intervals are 95 % over seeds. *Idle* counts seeds in which a food robot takes part in "
        f"less than {IDLE:g} of the rescues, with the rates that the count is compatible with.\n",
        "## How claims are decided\n",
        RULES,
        "## What the seed decides\n",
        markdown(seeds_table(situations)),
        "The correlation is ICC(3,1) of Shrout & Fleiss (1979), with its exact interval: the part "
        "of the variance of the first food robot's share that lies between seeds, after each "
        "arm's mean is taken away. The arms are those with parameters of their own: uniform "
        "attention, and inner attention with each λ. Shares are of all rescues of a run. Where "
        "all shares are near 0.5, the correlation is of small differences.\n",
        "## All arms\n",
        "![All runs, by arm](crossed.png)\n",
        "A dot is a run; a bar is the mean over seeds with its 95 % interval. Imbalance is the "
        "distance of a share from 0.5, a mean over tasks. Dotted lines: an imbalance of 0.1, a "
        f"share of {IDLE:g}, and uniform attention.\n",
        "Means of all arms and all effects are in [crossed_tables.md](crossed_tables.md), every "
        "run is in [crossed.csv](crossed.csv).\n",
    ]
    return "\n".join(parts)


def crossed_tables(situations: Sequence[Situation]) -> str:
    """The long tables: arms and effects by situation."""
    parts = ["# The crossed design: all arms and effects\n"]
    for situation in situations:
        parts += [
            f"## {situation.name}\n",
            f"Means over seeds with 95 % intervals. {LAMBDA}\n",
            markdown(arms_table(situation)),
            "Effects with the seed as the unit; main effects are bold. Holm's p is adjusted for "
            "all main effects, or for all others. *Alike*: two one-sided tests at 5 % put the "
            "difference within the margin.\n",
            markdown(effects_table(situation.effects)),
        ]
    return "\n".join(parts)


def _correlations(situations: Sequence[Situation]) -> str:
    """What the seed says about who does more under team credit."""
    found = [
        f"{format_estimate(one.correlation)} in {situation.name}"
        for situation in situations
        for one in situation.seeds
        if one.credit == "team" and one.correlation is not None
    ]
    if not found:
        return "There are too few seeds to say how alike the runs of one seed are."
    *others, last = found
    listed = f"{', '.join(others)} and {last}" if others else last
    return (
        "Under team credit, the intraclass correlation of runs of one seed is "
        f"{listed}: 0 means that the seed says nothing about which robot does more, "
        "1 that it says everything."
    )
