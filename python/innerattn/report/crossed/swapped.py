"""The page on runs whose food robots swap their initial weights, as files in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.experiments.crossed.swapped import Swap, read_swaps
from innerattn.experiments.run import FinishedRun
from innerattn.report.folder import ReportFolder, left_out_list, listed_runs
from innerattn.report.plots.drawing import check_format
from innerattn.report.plots.seeds import SeedPanel, draw_seeds
from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.stats.estimate import as_json
from innerattn.stats.text import format_estimate, format_number

SCHEMA_VERSION = 1
FILES = tuple(f"swapped.{kind}" for kind in ("json", "md", "pdf", "png"))
"""What `write` writes."""
ANSWER = "What decides which food robot does more"
SHARES = "Shares by seed"
"""Headings of the page's sections."""


def write(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str] = ()
) -> list[Swap]:
    """Write `FILES` into ``out``; the same runs give the same bytes.

    Args:
        runs: finished runs, at least one; they are read only.
        out: folder of the study; the runs' folders are named from there.
        budget: name of the budget they were trained with.
        left_out: what is said of runs that were planned and are not among ``runs``.

    Returns:
        What the report says, by situation and method.

    Raises:
        RunError: records cannot be read, a run's team has not two food robots, or matplotlib is not
            installed.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    check_format(out / "swapped.png")
    found = read_swaps(runs)
    folder = ReportFolder(out, budget)
    document = {
        "schema_version": SCHEMA_VERSION,
        "budget": budget,
        "swaps": as_json(found),
        "runs": listed_runs(runs, out),
    }
    folder.json("swapped.json", document)
    folder.draw("swapped", draw_seeds([[seed_panel(one) for one in found]]))
    folder.markdown("swapped.md", swapped_page(found, budget, left_out))
    return found


def swapped_page(found: Sequence[Swap], budget: str, left_out: Sequence[str]) -> str:
    """The page."""
    parts = [
        "# Whose weights, whose share\n",
        *left_out_list(left_out),
        f"Two runs for each seed, budget `{budget}`, team credit: one with the initial weights as "
        "they are drawn, one in which the two food robots swap theirs. Shares are of all rescues, "
        "by the first food robot.\n",
        f"## {ANSWER}\n",
        markdown(answers_table(found)),
        f"## {SHARES}\n",
        markdown(shares_table(found)),
    ]
    return "\n".join(parts)


def answers_table(found: Sequence[Swap]) -> Table:
    """A row for each situation and method."""
    rows = [
        [
            one.situation,
            one.method,
            str(len(one.pairs)),
            format_estimate(one.correlation),
            one.answer,
        ]
        for one in found
    ]
    heads = ["seeds", "correlation of the two shares [95 %]", "decided by"]
    return plain_table(columns(["situation", "method"], heads), rows)


def shares_table(found: Sequence[Swap]) -> Table:
    """A row for each pair of runs."""
    rows = [
        [one.situation, one.method, str(pair.seed), *map(format_number, (pair.drawn, pair.swapped))]
        for one in found
        for pair in one.pairs
    ]
    heads = ["seed", "share, weights as drawn", "share, weights swapped"]
    return plain_table(columns(["situation", "method"], heads), rows)


def seed_panel(swap: Swap) -> SeedPanel:
    """The two shares of each seed."""
    return SeedPanel(
        f"{swap.situation}, {swap.method}",
        {
            "weights as drawn": {pair.seed: pair.drawn for pair in swap.pairs},
            "weights swapped": {pair.seed: pair.swapped for pair in swap.pairs},
        },
    )
