"""The tables that an evaluation is shown as; every figure comes from its summary."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from innerattn.config import Scenario
    from innerattn.evaluate import Estimate, Performance, Summary

_KEY = """\
  random: any action, each with the same chance
  greedy: each robot to the nearest victim it can help
  hungarian: robots assigned to victims by arrival time
  score: 0 plays like random, 1 like hungarian; ± is half the 95 % interval
"""
_MOST_COLUMNS = 4  # that 80 columns hold beside names
_KEY_OF_SEEDS = """\
  score: 0 plays like random, 1 like hungarian
  mean: ± is half the 95 % interval over seeds (Student's t), in the same worlds
"""


def print_summary(console: Console, summary: Summary, scenario: Scenario) -> None:
    """Print what an evaluation found, for a reader who knows the task but not the program.

    Args:
        console: where to.
        summary: the figures.
        scenario: the worlds they were measured in.
    """
    console.print(f"\nRescues per episode, situation {summary.situation}", style="bold")
    console.print(_rescues(summary))
    console.print(_KEY)
    if summary.warm_start != "none":
        console.print(
            f"  {summary.method} was warm-started from {summary.warm_start}: it imitated that "
            f"script,\n  then learnt from rewards\n"
        )
    if any(summary.cooperation.values()):
        console.print(
            f"Who helped where several robots could: rescues in {summary.episodes:,} episodes "
            f"of {summary.standard.episode_steps} steps",
            style="bold",
        )
        console.print(_cooperation(summary, scenario))
    if summary.attention_entropy:
        console.print("Attention entropy of each robot's critic, in nats", style="bold")
        for table in _attention(summary):
            console.print(table)
        if scenario.num_robots > 2:
            others = scenario.num_robots - 1
            console.print(
                f"  100% is ln {others} = {math.log(others):.2f}: even attention over "
                f"{others} teammates; less is more selective\n"
            )


def print_seeds(console: Console, summaries: Mapping[int, Summary | None]) -> None:
    """Print what the runs of several seeds found, and their mean.

    Args:
        console: where to.
        summaries: the figures by seed, in order; None for a run that failed.
    """
    found = [summary for summary in summaries.values() if summary is not None]
    if not found:
        return
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("seed")
    for figures in (found[0].standard, found[0].long):
        table.add_column(f"{figures.episode_steps} steps", justify="right")
        table.add_column("score", justify="right")
    for seed, summary in summaries.items():
        cells = [_mean(x) for x in _of_seed(summary)] if summary else ["failed"]
        table.add_row(str(seed), *cells)
    if len(found) > 1:
        table.add_section()
        columns = zip(*(_of_seed(summary) for summary in found), strict=True)
        table.add_row(f"mean of {len(found)}", *map(_over_seeds, columns), style="bold")
    console.print(f"\nRescues per episode, situation {found[0].situation}", style="bold")
    console.print(table)
    console.print(_KEY_OF_SEEDS)


def _of_seed(summary: Summary) -> list[Estimate | None]:
    lengths = (summary.standard, summary.long)
    return [x for figures in lengths for x in (figures.rescues_per_episode, figures.score)]


def _over_seeds(intervals: Sequence[Estimate | None]) -> str:
    from innerattn.stats.student import student_interval

    means = [interval.mean for interval in intervals if interval is not None]
    return plus_minus(student_interval(means) if len(means) == len(intervals) else None)


def _mean(interval: Estimate | None) -> str:
    return "-" if interval is None else f"{interval.mean:.2f}"


def _rescues(summary: Summary) -> Table:
    lengths = (summary.standard, summary.long)
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("policy")
    for figures in lengths:
        table.add_column(f"{figures.episode_steps} steps", justify="right")
        table.add_column("score", justify="right")
    for name in summary.standard.scripted:
        if name != summary.method:
            cells = [cell for figures in lengths for cell in _scripted_cells(figures, name)]
            table.add_row(name, *cells)
    own = [
        cell
        for figures in lengths
        for cell in (plus_minus(figures.rescues_per_episode), plus_minus(figures.score))
    ]
    scripted = summary.method in summary.standard.scripted
    table.add_row(summary.method if scripted else f"{summary.method} (trained)", *own, style="bold")
    table.add_section()
    table.add_row("episodes", *(cell for f in lengths for cell in (f"{f.episodes:,}", "")))
    return table


def _scripted_cells(figures: Performance, name: str) -> tuple[str, str]:
    means = {policy: interval.mean for policy, interval in figures.scripted.items()}
    span = means["hungarian"] - means["random"]
    score = f"{(means[name] - means['random']) / span:.2f}" if figures.score else "-"
    return plus_minus(figures.scripted[name]), score


def plus_minus(interval: Estimate | None) -> str:
    """A mean and half its interval, as tables show them."""
    if interval is None or not interval.bounded:
        return "-"
    return f"{interval.mean:.2f} ± {(interval.high - interval.low) / 2:.2f}"


def _cooperation(summary: Summary, scenario: Scenario) -> Table:
    counts = summary.cooperation
    robots = list(dict.fromkeys(name for of_task in counts.values() for name in of_task))
    rows = [["task", *robots]]
    for task in scenario.tasks:
        of_task = counts[task.name]
        total = sum(of_task.values())
        cells = [_with_share(of_task[robot], total) if robot in of_task else "" for robot in robots]
        rows.append([f"{task.name} ({' + '.join(task.needs)})", *cells])
    if len(robots) > _MOST_COLUMNS:
        rows = [list(column) for column in zip(*rows, strict=True)]
        rows[0][0] = "robot"
    return _table(rows)


def _with_share(count: int, total: int) -> str:
    return f"{count:,} ({count / total:.0%})" if total else "0"


def _attention(summary: Summary) -> list[Table]:
    """A table for every few heads."""
    heads = len(next(iter(summary.attention_entropy.values())))
    return [
        _attention_of(summary, range(first, min(first + _MOST_COLUMNS, heads)))
        for first in range(0, heads, _MOST_COLUMNS)
    ]


def _attention_of(summary: Summary, heads: range) -> Table:
    rows = [["robot", *(f"head {head + 1}" for head in heads)]]
    for robot, nats in summary.attention_entropy.items():
        shares = summary.attention_entropy_share[robot]
        cells = [
            f"{nats[head]:.2f}" + ("" if (share := shares[head]) is None else f" ({share:.0%})")
            for head in heads
        ]
        rows.append([robot, *cells])
    return _table(rows)


def _table(rows: Sequence[Sequence[str]]) -> Table:
    """The first row is the head; figures stand to the right."""
    table = Table(box=box.SIMPLE_HEAD)
    for number, name in enumerate(rows[0]):
        table.add_column(name, justify="right" if number else "left", overflow="fold")
    for row in rows[1:]:
        table.add_row(*row)
    return table
