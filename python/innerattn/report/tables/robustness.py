"""The tables that robustness is shown as."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

from innerattn.report.tables.evaluation import plus_minus

if TYPE_CHECKING:
    from innerattn.evaluate import Estimate
    from innerattn.evaluate.bounds.results import Bounds
    from innerattn.evaluate.faults.grid import Grid, Retention
    from innerattn.measures.faults.shift_results import FaultAttention

_KEY = """\
  kept: rescues with a fault / rescues without it, in the same worlds, since its
  onset; mean over robots, onsets, severities from 0 to 1; ± is half the 95 %
  interval; greedy and hungarian take all robots to be healthy, oracle knows of
  faults
"""
_BOUNDS_KEY = """\
  median and largest, for changes of a teammate's observation found by gradient
  ascent; radius: size of the change, in norms of an observation; Q: of its
  teammates; flips: another action is best by Q, or is taken by the actor of the
  disturbed robot, which no bound is about
"""
_ATTENTION_KEY = """\
  mean over teammates, heads and robots ({even:.2f} where attention is even), beside
  the same worlds without the fault; AUC: how often a faulty robot gets more
  weight than a healthy one; 0.5 tells nothing, below 0.5 faults turn it away
"""
_MOST_WITH_INTERVALS = 4  # policies that 80 columns hold with their intervals


def print_robustness(
    console: Console,
    grid: Grid,
    found: Mapping[str, Retention],
    bounds: Mapping[str, Bounds],
    attention: Mapping[str, FaultAttention],
) -> None:
    """Print what was measured, for a reader who knows the task but not the program.

    Args:
        console: where to.
        grid: the faults.
        found: what each policy keeps, by name, the first one first.
        bounds: of each run's critic, by name.
        attention: of each run with learnt attention, by name.
    """
    from innerattn.policies import SCRIPTED

    scenario = grid.scenario
    console.print(
        f"\nRescues kept when a robot fails: {scenario.situation}, {grid.episodes:,} worlds of "
        f"{scenario.episode_steps} steps",
        style="bold",
    )
    # Names of runs are too long to stand over columns.
    runs = [name for name in found if name not in (*SCRIPTED, "oracle")]
    heads = [f"run {i + 1}" if name in runs else name for i, name in enumerate(found)]
    console.print(_by_kind(grid, found, heads))
    for head, name in zip(heads, runs, strict=False):
        console.print(f"  {head}: {name}", soft_wrap=True)
    console.print(_KEY)
    first, kept = next(iter(found.items()))
    console.print(f"{first}: a fault from the start, by severity (mean over robots)", style="bold")
    console.print(_by_severity(grid, kept))
    console.print(f"{first}: before and after a fault from step {grid.middle}", style="bold")
    console.print(_after_onset(grid, kept))
    for name, of_run in bounds.items():
        _print_bounds(console, name, of_run)
        if name in attention:
            _print_attention(console, name, attention[name])


def _by_kind(grid: Grid, found: Mapping[str, Retention], heads: Sequence[str]) -> Table:
    show = plus_minus if len(found) <= _MOST_WITH_INTERVALS else _mean
    table = _table("kept", *heads)
    means = {name: kept.by_kind() for name, kept in found.items()}
    for k, kind in enumerate(grid.kinds):
        table.add_row(_words(kind), *(show(mean[k].estimate()) for mean in means.values()))
    table.add_section()
    overall = [show(mean.mean(0).estimate()) for mean in means.values()]
    table.add_row("all kinds", *overall, style="bold")
    clean = [show(kept.clean.estimate()) for kept in found.values()]
    table.add_row("rescues", *clean)
    return table


def _by_severity(grid: Grid, kept: Retention) -> Table:
    from innerattn.evaluate.faults.document import worst_robot

    table = _table("severity", *(f"{severity:g}" for severity in grid.severities))
    table.add_column(f"worst robot at {grid.severities[-1]:g}", justify="right")
    for k, kind in enumerate(grid.kinds):
        curve = kept.cells.value[k, :, :, 0].mean(1)
        robot, interval = worst_robot(grid, kept, k)
        cells = [f"{value:.2f}" for value in curve]
        table.add_row(_words(kind), *cells, f"{robot} {plus_minus(interval)}")
    return table


def _after_onset(grid: Grid, kept: Retention) -> Table:
    steps = grid.scenario.episode_steps
    half = grid.middle + (steps - grid.middle) // 2
    table = _table(
        "kept", f"steps {grid.middle} to {half}", f"steps {half} to {steps}", "difference"
    )
    early, late = kept.early.mean((1, 2)), kept.late.mean((1, 2))
    for k, kind in enumerate(grid.kinds):
        parts = (early[k], late[k], late[k] - early[k])
        table.add_row(_words(kind), *(plus_minus(part.estimate()) for part in parts))
    return table


def _print_bounds(console: Console, name: str, bounds: Bounds) -> None:
    """How the critic's bounds did (docs/robustness.md)."""
    checks = [check for level in bounds.levels for check in level.checks.values()]
    if not checks:
        console.print(f"{name}: no learnt attention, so that no bound on it can be checked\n")
        return
    count = sum(check.checks for check in checks)
    console.print(
        f"{name}: bounds on attention (eqs. 6-10),\n"
        f"{bounds.violations} violations in {count:,} checks",
        style="bold",
    )
    table = _table(
        "radius", *("logit / bound", "change of weight", "change of Q", "Q flips", "actor flips")
    )
    for level in bounds.levels:
        if (level.changed, level.direction) != ("observation", "gradient"):
            continue
        logit, weight = level.checks["logit"], level.checks["weight"]
        assert level.teammates is not None
        table.add_row(
            f"{level.radius:g}",
            f"{logit.median_tightness:.2f}, {logit.largest_tightness:.2f}",
            f"{weight.median_change:.2f}, {weight.largest_change:.2f}",
            f"{level.teammates.median:.2f}, {level.teammates.largest:.2f}",
            _share(level.teammates.flips),
            _share(level.actor_flips),
        )
    console.print(table)
    console.print(_BOUNDS_KEY)


def _print_attention(console: Console, name: str, found: FaultAttention) -> None:
    """Where the critic's attention goes when a robot fails for good."""
    console.print(
        f"{name}: attention paid to a robot that fails at step {found.onset_step}", style="bold"
    )
    table = _table("worst fault", "weight, no fault", "change by the fault", "AUC")
    for kind in found.kinds:
        after = [shift.after.mean.mean - shift.effect.mean.mean for shift in kind.robots]
        table.add_row(
            _words(kind.kind),
            f"{sum(after) / len(after):.2f}",
            plus_minus(kind.effect.mean),
            plus_minus(kind.auc.mean),
        )
    table.add_section()
    table.add_row(
        "all kinds", "", plus_minus(found.effect.mean), plus_minus(found.auc.mean), style="bold"
    )
    console.print(table)
    console.print(_ATTENTION_KEY.format(even=found.even_share))


def _table(first: str, *columns: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column(first, no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    return table


def _words(kind: str) -> str:
    return kind.replace("_", " ")


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"


def _mean(interval: Estimate) -> str:
    return "-" if math.isnan(interval.mean) else f"{interval.mean:.2f}"
