"""The table that a study is shown as: what its runs scored, by situation and method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

from innerattn.report.tables.evaluation import plus_minus

if TYPE_CHECKING:
    from innerattn.experiments.run import Scores
    from innerattn.experiments.scan import RunStatus

_KEY = """\
  score: 0 plays like random, 1 like hungarian
  ±: half the 95 % interval over seeds (Student's t), where there are several
"""


def print_scores(console: Console, found: Sequence[RunStatus]) -> None:
    """Print what the finished runs scored, over seeds.

    Args:
        console: where to.
        found: what is there of each run, whether it can be used or not.
    """
    cells: dict[tuple[str, str], list[tuple[Scores, Scores] | None]] = {}
    for one in found:
        planned = one.planned
        measured = one.run.scores() if one.run else None
        cells.setdefault((planned.case.situation, planned.case.trained), []).append(measured)
    lengths = next((two for runs in cells.values() for two in runs if two is not None), None)
    if lengths is None:
        return
    table = Table(box=box.SIMPLE_HEAD, padding=0)
    table.add_column("method", no_wrap=True)
    table.add_column("runs", justify="right")
    for measured_at in lengths:
        table.add_column(f"{measured_at.episode_steps} steps", justify="right")
        table.add_column("score", justify="right")
    before = None
    for (situation, method), runs in cells.items():
        if situation != before:
            table.add_section()
            table.add_row(situation, style="bold")
            before = situation
        used = [two for two in runs if two is not None]
        table.add_row(f"  {method}", f"{len(used)} of {len(runs)}", *_figures(used))
    console.print("\nRescues per episode, mean over runs", style="bold")
    console.print(table)
    console.print(_KEY)


def _figures(runs: Sequence[tuple[Scores, Scores]]) -> list[str]:
    return [
        text
        for length in (0, 1)
        for text in (
            _over_seeds([run[length].rescues_per_episode for run in runs]),
            _over_seeds([run[length].score for run in runs]),
        )
    ]


def _over_seeds(values: Sequence[float | None]) -> str:
    from innerattn.stats.student import student_interval

    known = [value for value in values if value is not None]
    if not known or len(known) < len(values):
        return "-"
    return f"{known[0]:.2f}" if len(known) == 1 else plus_minus(student_interval(known))
