"""The tables that an evaluation is shown as in a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from rich.console import Console

from innerattn.config.amounts import in_words
from innerattn.policies import best_script
from innerattn.report.table import Row, Table, columns, plain_table, print_table, section
from innerattn.report.tables.text import number, plus_minus
from innerattn.stats import Estimate

if TYPE_CHECKING:
    from innerattn.config import Scenario
    from innerattn.evaluate import Performance, Summary
    from innerattn.experiments.score_means import MeanScores, SeedScores, TwoLengths

_POLICIES = (
    "random: any action, each with the same chance",
    "greedy: each robot to the nearest victim it can help",
    "hungarian: robots assigned to victims by arrival time",
)
_PLANNER = "planner: the first step of a plan for all victims that are there"
_SEEN = "greedy-seen: each robot to the nearest victim it has seen and can help, or searching"
_SEEDS = (
    "score: 0 plays like random, 1 like the best script",
    "mean: ± is half the 95 % interval over seeds (Student's t), in the same worlds",
)
_MOST_COLUMNS = 4  # that 80 columns hold beside names


def print_summary(console: Console, summary: Summary, scenario: Scenario) -> None:
    """Print what an evaluation found, for a reader who knows the task but not the program.

    Args:
        console: where to.
        summary: what was measured.
        scenario: the worlds it was measured in.
    """
    console.print()
    print_table(console, _rescues(summary))
    if scenario.has_deadlines:
        title = "Share of victims rescued before their deadline"
        note = "lost: victims per episode whose deadline passed"
        print_table(console, _of_policies(summary, _lost_cells, ["lost"], title, note))
    if scenario.has_arrivals:
        title = "Victims turned away per episode"
        note = "turned away: they arrived when all slots of their task were taken"
        print_table(console, _of_policies(summary, _turned_away_cells, [], title, note))
    if scenario.end_when_done:
        title = "Time until all victims were done [s]"
        note = "done: share of the episodes in which they were; the time is the mean of these alone"
        print_table(console, _of_policies(summary, _makespan_cells, ["done"], title, note))
    if any(summary.cooperation.values()):
        print_table(console, _cooperation(summary, scenario))
    if summary.attention_entropy:
        for table in _attention(summary, scenario.num_robots - 1):
            print_table(console, table)


def print_seeds(console: Console, scores: SeedScores | None) -> None:
    """Print what the runs of several seeds scored, and their mean.

    Args:
        console: where to.
        scores: by seed; nothing is printed without.
    """
    if scores is None:
        return
    standard, long = scores.mean
    lengths = (standard.episode_steps, long.episode_steps)
    runs = section(
        [str(seed), *(_scores_shown(two) if two else ["failed"])]
        for seed, two in scores.by_seed.items()
    )
    used = sum(two is not None for two in scores.by_seed.values())
    parts = [runs]
    if used > 1:
        shown = [plus_minus(x) for one in scores.mean for x in (one.rescues_per_episode, one.score)]
        parts.append(section([Row((f"mean of {used}", *shown), strong=True)]))
    title = f"Rescues per episode, situation {scores.situation}"
    console.print()
    print_table(console, Table(columns(["seed"], _heads(lengths)), tuple(parts), title, _SEEDS))


def result_line(summary: Summary) -> str:
    """What an evaluation found, in one line."""
    return _scored(summary.standard)


def seeds_line(scores: SeedScores) -> str:
    """The mean over seeds, in one line."""
    used = sum(two is not None for two in scores.by_seed.values())
    return f"{_scored(scores.mean[0])}, mean of {used} of {len(scores.by_seed)} seeds"


def _scored(found: Performance | MeanScores) -> str:
    return (
        f"{plus_minus(found.rescues_per_episode)} rescues per episode of {found.episode_steps} "
        f"steps, score {plus_minus(found.score)}"
    )


def _scores_shown(two: TwoLengths) -> list[str]:
    return [number(x) for one in two for x in (one.rescues_per_episode, one.score)]


def _heads(lengths: Sequence[int]) -> list[str]:
    return [head for steps in lengths for head in (f"{steps} steps", "score")]


def _rescues(summary: Summary) -> Table:
    lengths = (summary.standard, summary.long)
    rows = [
        Row((name, *(cell for one in lengths for cell in _scripted_cells(one, name))))
        for name in summary.standard.scripted
        if name != summary.method
    ]
    scripted = summary.method in summary.standard.scripted
    name = summary.method if scripted else f"{summary.method} (trained)"
    own = [plus_minus(x) for one in lengths for x in (one.rescues_per_episode, one.score)]
    rows.append(Row((name, *own), strong=True))
    counts = [cell for one in lengths for cell in (f"{one.episodes:,}", "")]
    best = best_script(summary.standard.scripted)
    others = [_PLANNER] if best == "planner" else []
    others += [_SEEN] if "greedy-seen" in summary.standard.scripted else []
    score = f"score: 0 plays like random, 1 like {best}; ± is half the 95 % interval"
    warm = () if summary.warm_start == "none" else (_warm_start(summary),)
    return Table(
        columns(["policy"], _heads([one.episode_steps for one in lengths])),
        (section(rows), section([["episodes", *counts]])),
        f"Rescues per episode, situation {summary.situation}",
        (*_POLICIES, *others, score, *warm),
    )


def _of_policies(
    summary: Summary,
    cells: Callable[[Performance, str], tuple[str, ...]],
    second: Sequence[str],
    title: str,
    note: str,
) -> Table:
    """What the measures of scripts and of what is measured are, at both lengths of episodes.

    Args:
        summary: what was measured.
        cells: of a policy at a length of episodes.
        second: head of the second of the cells, where there are two.
        title: what the first one is.
        note: what the table does not say.
    """
    lengths = (summary.standard, summary.long)
    scripts = [name for name in summary.standard.scripted if name != summary.method]
    rows = [
        Row((name, *(x for one in lengths for x in cells(one, name))), name == summary.method)
        for name in (*scripts, summary.method)
    ]
    heads = [head for one in lengths for head in (f"{one.episode_steps} steps", *second)]
    return plain_table(columns(["policy"], heads), rows, title, [note])


def _turned_away_cells(measured: Performance, name: str) -> tuple[str]:
    turned_away = measured.measures[name]["turned_away"]
    assert isinstance(turned_away, int)
    return (number(turned_away / measured.episodes),)


def _makespan_cells(measured: Performance, name: str) -> tuple[str, str]:
    found = measured.measures[name]
    makespan, done = found["makespan_s"], found["done"]
    assert isinstance(makespan, Estimate | None)
    assert isinstance(done, Estimate)
    return plus_minus(makespan), number(done.mean)


def _lost_cells(measured: Performance, name: str) -> tuple[str, str]:
    found = measured.measures[name]
    in_time, lost = found["in_time"], found["lost"]
    assert isinstance(in_time, Estimate | None)
    assert isinstance(lost, int)
    return plus_minus(in_time), number(lost / measured.episodes)


def _warm_start(summary: Summary) -> str:
    return (
        f"{summary.method} was warm-started from {summary.warm_start}: its training began by "
        "imitating that script"
    )


def _scripted_cells(measured: Performance, name: str) -> tuple[str, str]:
    return plus_minus(measured.scripted[name]), number(measured.script_score(name))


def _cooperation(summary: Summary, scenario: Scenario) -> Table:
    counts = {
        f"{task.name} ({' + '.join(in_words(task.needs))})": summary.cooperation[task.name]
        for task in scenario.tasks
    }
    robots = list(dict.fromkeys(name for of_task in counts.values() for name in of_task))
    if len(counts) > _MOST_COLUMNS:
        together = {robot: sum(one.get(robot, 0) for one in counts.values()) for robot in robots}
        counts = {f"all {len(counts)} tasks": together}
    rows = [["task", *robots]]
    for task, of_task in counts.items():
        total = sum(of_task.values())
        cells = [_with_share(of_task[robot], total) if robot in of_task else "" for robot in robots]
        rows.append([task, *cells])
    if len(robots) > _MOST_COLUMNS:
        rows = [list(column) for column in zip(*rows, strict=True)]
        rows[0][0] = "robot"
    return plain_table(
        columns(rows[0][:1], rows[0][1:]),
        rows[1:],
        f"Who helped where several robots could: rescues in {summary.episodes:,} episodes "
        f"of {summary.standard.episode_steps} steps",
    )


def _with_share(count: int, total: int) -> str:
    return f"{count:,} ({count / total:.0%})" if total else "0"


def _attention(summary: Summary, teammates: int) -> list[Table]:
    """A table for every few heads, titled above the first and explained below the last."""
    heads = len(next(iter(summary.attention_entropy.values())))
    tables = [
        _attention_of(summary, range(first, min(first + _MOST_COLUMNS, heads)))
        for first in range(0, heads, _MOST_COLUMNS)
    ]
    title = "Attention entropy of each robot's critic, in nats"
    tables[0] = replace(tables[0], title=title)
    if teammates > 1:
        note = (
            f"100% is ln {teammates} = {math.log(teammates):.2f}: even attention over "
            f"{teammates} teammates; less is more selective"
        )
        tables[-1] = replace(tables[-1], notes=(note,))
    return tables


def _attention_of(summary: Summary, heads: Sequence[int]) -> Table:
    rows = []
    for robot, nats in summary.attention_entropy.items():
        shares = summary.attention_entropy_share[robot]
        cells = [
            f"{nats[head]:.2f}" + ("" if (share := shares[head]) is None else f" ({share:.0%})")
            for head in heads
        ]
        rows.append([robot, *cells])
    return plain_table(columns(["robot"], [f"head {head + 1}" for head in heads]), rows)
