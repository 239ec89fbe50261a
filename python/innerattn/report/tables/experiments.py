"""The table that a study is shown as in a terminal: what its runs scored."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console

from innerattn.report.table import Table, columns, print_table, section
from innerattn.report.tables.text import plus_minus

if TYPE_CHECKING:
    from innerattn.experiments.score_means import MethodScores

_NOTES = (
    "score: 0 plays like random, 1 like hungarian",
    "±: half the 95 % interval over seeds (Student's t), where there are several",
)


def print_scores(console: Console, scores: Sequence[MethodScores]) -> None:
    """Print what the runs of a study scored, by situation and method.

    Args:
        console: where to.
        scores: by situation and method; nothing is printed where no run is finished.
    """
    lengths = next((one.mean for one in scores if one.mean is not None), None)
    if lengths is None:
        return
    heads = [head for one in lengths for head in (f"{one.episode_steps} steps", "score")]
    rows: dict[str, list[list[str]]] = {}
    for one in scores:
        row = [one.method, f"{one.used} of {one.planned}", *_means(one)]
        rows.setdefault(one.situation, []).append(row)
    parts = [section(own, situation) for situation, own in rows.items()]
    title = "Rescues per episode, mean over runs"
    console.print()
    table = Table(columns(["method"], ["runs", *heads]), tuple(parts), title, _NOTES)
    print_table(console, table, dense=True)


def _means(scores: MethodScores) -> list[str]:
    if scores.mean is None:
        return ["-"] * 4
    return [plus_minus(x) for one in scores.mean for x in (one.rescues_per_episode, one.score)]
