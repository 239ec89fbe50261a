"""The tables that robustness is shown as in a terminal."""

from __future__ import annotations

import math
import string
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from rich.console import Console

from innerattn.report.table import Row, Table, columns, plain_table, print_table, section
from innerattn.report.tables.text import NONE, mean_alone, number, percent, plus_minus

if TYPE_CHECKING:
    from innerattn.config import Scenario
    from innerattn.evaluate.bounds.results import Bounds, Level
    from innerattn.evaluate.faults.grid import Grid, Retention
    from innerattn.evaluate.faults.overview import KindOverview, Overview
    from innerattn.measures.faults.shift_results import FaultAttention

_RETENTION = (
    "retention: rescues with a fault / rescues without it, in the same worlds, from its onset on; "
    "mean over robots, onsets, severities from 0 to 1; ± is half the 95 % interval",
    "rescues: per episode; with a fault from its start, mean over kinds, severities, robots",
    "greedy and hungarian take all robots to be healthy, oracle knows of faults",
)
_NO_SHARE = f"{NONE}: too few rescues without a fault to give a share of them"
_BOUNDS = (
    "each cell: median, largest; teammates' observations were changed by gradient ascent",
    "radius: size of the change, in norms of an observation; Q: of its teammates; flips: another "
    "action is best by Q, or is taken by the actor of the disturbed robot, which no bound covers",
)
_ALPHABET = string.ascii_uppercase
_MOST_NAMED = 2  # runs that one line of 80 columns holds
_MOST_WITH_INTERVALS = 4  # policies that 80 columns hold with their intervals
_WIDTH = 80


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
        found: retention of each policy, by name, the first one first.
        bounds: of each run's critic, by name.
        attention: of each run with learnt attention, by name.
    """
    from innerattn.evaluate.faults.overview import overview

    policies = {name: overview(grid, one) for name, one in found.items()}
    letters = run_letters(found)
    console.print()
    for line in verdict(grid.scenario, policies, letters):
        console.print(textwrap.fill(line, _WIDTH), style="bold", soft_wrap=True)
    console.print()
    for name, letter in letters.items():
        console.print(f"{letter}: {name}", soft_wrap=True)
    console.print()
    print_table(console, _by_kind(grid, policies, letters))
    first, own = next(iter(policies.items()))
    print_table(console, _by_severity(grid, letters.get(first, first), own))
    oracle = policies.get("oracle")
    print_table(console, _after_onset(grid, letters.get(first, first), own, oracle))
    for name, of_run in bounds.items():
        letter = letters.get(name, name)
        if any(level.checks for level in of_run.levels):
            print_table(console, _bounds(letter, of_run))
        else:
            console.print(f"{letter}: no learnt attention, so no bound on it can be checked\n")
        if name in attention:
            print_table(console, _attention(letter, attention[name]))


def robustness_line(grid: Grid, found: Mapping[str, Retention]) -> str:
    """What was measured, in one line; it names the runs as they are."""
    from innerattn.evaluate.faults.overview import overview

    policies = {name: overview(grid, one) for name, one in found.items()}
    return _kept(policies, {name: name for name in run_letters(found)})


def run_letters(found: Mapping[str, object]) -> dict[str, str]:
    """A short name for each run, in their order: A to Z, then A2 and so on."""
    from innerattn.policies import SCRIPTED

    runs = [name for name in found if name not in (*SCRIPTED, "oracle")]
    return {
        name: _ALPHABET[i % 26] + (str(i // 26 + 1) if i >= 26 else "")
        for i, name in enumerate(runs)
    }


def verdict(
    scenario: Scenario, policies: Mapping[str, Overview], letters: Mapping[str, str]
) -> list[str]:
    """What was found, in words: whose loss costs each run most and why, then what a run keeps.

    Args:
        scenario: the worlds; it tells what each robot offers.
        policies: what was measured, the runs first.
        letters: how each run is called.
    """
    lines = []
    for name, letter in list(letters.items())[:_MOST_NAMED]:
        subject = "the team" if len(letters) == 1 else letter
        lines.append(_in_words(scenario, subject, policies[name]))
    return [*lines, _kept(policies, letters), _costs_most(policies, letters)]


def _in_words(scenario: Scenario, subject: str, found: Overview) -> str:
    """What a run keeps without its most needed robot, or under the worst fault that was tried."""
    known = [kind for kind in found.kinds if not math.isnan(kind.worst.mean)]
    if not known:
        return f"{subject[0].upper()}{subject[1:]} rescues nobody, so it cannot lose rescues."
    lost = [kind for kind in known if kind.kind == "unavailable"]
    kind = min(lost or known, key=lambda kind: kind.worst.mean)
    what = f"Without {kind.worst_robot}" if lost else f"With {_fault_of(kind)}"
    alone = _offered_by_nobody_else(scenario, kind.worst_robot)
    why = f": nobody else offers {' and '.join(alone)}" if alone else ""
    return f"{what} {subject} keeps {100.0 * kind.worst.mean:.0f} % of its rescues{why}."


def _fault_of(kind: KindOverview) -> str:
    return f"the worst {_words(kind.kind)} of {kind.worst_robot}"


def _offered_by_nobody_else(scenario: Scenario, name: str) -> list[str]:
    """The abilities that tasks need and only this robot has."""
    needed = {need for task in scenario.tasks for need in task.needs}
    others = {able for robot in scenario.robots if robot.name != name for able in robot.abilities}
    (own,) = (robot.abilities for robot in scenario.robots if robot.name == name)
    return [able for able in own if able in needed and able not in others]


def _kept(policies: Mapping[str, Overview], letters: Mapping[str, str]) -> str:
    """What each run keeps when a robot fails, beside a script."""
    kept = [f"{letter} {plus_minus(policies[name].retention)}" for name, letter in letters.items()]
    if len(kept) > _MOST_NAMED:
        means = [policies[name].retention.mean for name in letters]
        known = [mean for mean in means if not math.isnan(mean)]
        between = f"{min(known):.2f} to {max(known):.2f}" if known else NONE
        kept = [f"{len(means)} runs {between}"]
    if "hungarian" in policies:
        kept.append(f"hungarian {plus_minus(policies['hungarian'].retention)}")
    return f"Share of rescues kept when a robot fails: {', '.join(kept)}"


def _costs_most(policies: Mapping[str, Overview], letters: Mapping[str, str]) -> str:
    worst = []
    for name, letter in list(letters.items())[:_MOST_NAMED]:
        kinds = [kind for kind in policies[name].kinds if not math.isnan(kind.retention.mean)]
        if kinds:
            kind = min(kinds, key=lambda kind: kind.retention.mean)
            worst.append(f"{letter} {_words(kind.kind)} {plus_minus(kind.retention)}")
    return f"Fault that costs most: {', '.join(worst) or 'unknown, since the runs rescue nobody'}"


def _by_kind(grid: Grid, policies: Mapping[str, Overview], letters: Mapping[str, str]) -> Table:
    # Names of runs are too long to stand over columns.
    heads = [letters.get(name, name) for name in policies]
    shown = plus_minus if len(policies) <= _MOST_WITH_INTERVALS else mean_alone
    each = list(policies.values())
    kinds = section(
        [_words(kind), *(shown(one.kinds[k].retention) for one in each)]
        for k, kind in enumerate(grid.kinds)
    )
    overall = Row(("all kinds", *(shown(one.retention) for one in each)), strong=True)
    rescues = ["rescues, no fault", *(shown(one.rescues) for one in each)]
    with_fault = ["rescues, fault", *(shown(one.rescues_with_fault) for one in each)]
    table = Table(
        columns(["retention"], heads),
        (kinds, section([overall]), section([rescues, with_fault])),
        f"Retention when a robot fails: {grid.scenario.situation}, {grid.episodes:,} worlds of "
        f"{grid.scenario.episode_steps} steps",
        _RETENTION,
    )
    return _explained(table)


def _by_severity(grid: Grid, name: str, found: Overview) -> Table:
    rows = [
        [
            *(_words(kind.kind), *map(number, kind.by_severity)),
            f"{kind.worst_robot} {plus_minus(kind.worst)}",
        ]
        for kind in found.kinds
    ]
    severities = [f"{severity:g}" for severity in grid.severities]
    heads = columns(["severity"], [*severities, f"worst robot at {severities[-1]}"])
    title = f"{name}: a fault from the start, by severity (mean over robots)"
    return _explained(plain_table(heads, rows, title))


def _after_onset(grid: Grid, name: str, found: Overview, oracle: Overview | None) -> Table:
    """Whether a team recovers, beside the script that knows of the fault, where it was played."""
    steps = grid.scenario.episode_steps
    half = grid.middle + (steps - grid.middle) // 2
    heads = ["early", "late", "change", *(["oracle's"] if oracle else [])]
    rows = []
    for k, kind in enumerate(found.kinds):
        parts = [kind.early, kind.late, kind.change, *([oracle.kinds[k].change] if oracle else [])]
        rows.append([_words(kind.kind), *map(plus_minus, parts)])
    title = f"{name}: soon after a fault from step {grid.middle}, and later"
    notes = [
        f"early: steps {grid.middle} to {half}; late: steps {half} to {steps}; change: late - early"
    ]
    if oracle:
        notes.append("oracle's: the change of the script that knows of the fault")
    return _explained(plain_table(columns(["retention"], heads), rows, title, notes))


def _explained(table: Table, why: str = _NO_SHARE) -> Table:
    """The table; where a cell has no value, a note says why."""
    cells = (cell for part in table.sections for row in part.rows for cell in row.cells)
    lacks = any(cell.split()[-1:] == [NONE] for cell in cells)
    return replace(table, notes=(*table.notes, why)) if lacks else table


def _bounds(name: str, bounds: Bounds) -> Table:
    """How the critic's bounds did (docs/attention-bound.md)."""
    count = sum(check.checks for level in bounds.levels for check in level.checks.values())
    heads = ["logit / bound", "change of weight", "change of Q", "Q flips", "actor flips"]
    rows = [
        _level(level)
        for level in bounds.levels
        if (level.changed, level.direction) == ("observation", "gradient")
    ]
    checked = f"{bounds.violations} violations in {count:,} checks"
    title = f"{name}: bounds on attention (eqs. 5-9), {checked}"
    table = plain_table(columns(["radius"], heads), rows, title, _BOUNDS)
    return _explained(
        table, f"{NONE}: this critic does not rate each action, so it has no best one"
    )


def _level(level: Level) -> Sequence[str]:
    logit, weight, q = level.checks["logit"], level.checks["weight"], level.teammates
    assert q is not None
    return [
        f"{level.radius:g}",
        f"{logit.median_tightness:.2f}, {logit.largest_tightness:.2f}",
        f"{weight.median_change:.2f}, {weight.largest_change:.2f}",
        f"{q.median:.2f}, {q.largest:.2f}",
        percent(q.flips),
        percent(level.actor_flips),
    ]


def _attention(name: str, found: FaultAttention) -> Table:
    """Where the critic's attention goes when a robot fails for good."""
    from innerattn.evaluate.faults.overview import weight_without_fault

    kinds = section(
        [
            *(_words(kind.kind), number(weight_without_fault(kind))),
            *(plus_minus(kind.effect.mean), plus_minus(kind.auc.mean)),
        ]
        for kind in found.kinds
    )
    overall = ("all kinds", "", plus_minus(found.effect.mean), plus_minus(found.auc.mean))
    return Table(
        columns(["worst fault"], ["weight, no fault", "change by the fault", "AUC"]),
        (kinds, section([Row(overall, strong=True)])),
        f"{name}: attention paid to a robot that fails at step {found.onset_step}",
        (
            f"mean over teammates, heads and robots ({found.even_share:.2f} where attention is "
            "even), beside the same worlds without the fault",
            "AUC: how often a faulty robot gets more weight than a healthy one; 0.5 tells "
            "nothing, below 0.5 faults turn attention away",
        ),
    )


def _words(kind: str) -> str:
    return kind.replace("_", " ")
