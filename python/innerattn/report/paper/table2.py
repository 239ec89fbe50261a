"""Table II, how the two food robots share each task: as tables, and as values to compute with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from innerattn.experiments.paper.sharing_claims import share_shown, verdicts_shown
from innerattn.experiments.paper.table2 import Row, Sharing, Table2
from innerattn.measures.sharing.evenness import MARGIN, ChiSquared, Evenness, EvennessOfRuns
from innerattn.report.paper.competence import (
    competence_table,
    competence_terms,
    pairs_table,
    together_table,
)
from innerattn.report.table import Column, Table, columns, csv_text, markdown, plain_table
from innerattn.stats.text import NONE, format_estimate, format_number, format_p

_TERMS = f"""\
- **Share**: the part of a task's rescues in which the first food robot helped. Over several runs
  its intervals are Student's with the run as the unit; of a single run they are over its episodes.
- **Verdict**: *even* if the 90 % interval is within {MARGIN[0]} to {MARGIN[1]}, which is two
  one-sided tests at 5 % (p (TOST) is the larger p); *uneven* if the 95 % interval is outside; else
  *undecided*. Runs are counted by their own verdict, too: a mean near 0.5 can hide runs that are
  uneven in opposite ways.
- **Pooled share**: over the rescues of all runs added up, with a bootstrap of runs and of episodes
  within runs. Its interval is too short for few runs.
- **χ²**: of the rescues of all runs added up, as if they were independent; the test is at 5 %.
"""

_COLUMNS = """
situation method task seed episodes robot_0 robot_1 rescues_0 rescues_1 share_0 share_low share_high
share_low_90 share_high_90 chi_squared p equivalence_p verdict printed_share_0 printed_chi_squared
rescues_per_episode score
"""


def table2_markdown(table: Table2) -> str:
    """The long tables: both attentions, then sharing, every run and competence by situation."""
    parts = ["# Table II, and how well the same runs do\n", _TERMS, competence_terms()]
    if table.pairs:
        parts += [
            "## Learnt attention beside uniform attention\n",
            markdown(pairs_table(table.pairs)),
            "Each seed gives one difference; p is of the paired t-test. *Alike*: two one-sided "
            "tests at 5 % put the difference within the margin.\n",
        ]
    if table.together:
        parts += [
            markdown(together_table(table.together)),
            "Interquartile means of the score over situations, and the probability that a run "
            "with learnt attention scores higher (Agarwal et al. 2021). The bootstrap takes runs "
            "of one seed as independent, so intervals are too short where runs are few.\n",
        ]
    for situation in dict.fromkeys(row.situation for row in table.rows):
        rows = [row for row in table.rows if row.situation == situation]
        parts.append(f"## {situation}: sharing\n")
        for name in ("scored", "recorded"):
            episodes = sorted({getattr(row, name).episodes for row in rows})
            like = ", as in the paper" if name == "recorded" and episodes == [80] else ""
            parts.append(f"Over {_listed(episodes)} episodes of each run{like}:\n")
            parts.append(markdown(_sharing_table(rows, name)))
        parts += [f"## {situation}: every run\n", markdown(_runs_table(rows))]
        own = [part for part in table.competence if part.situation == situation]
        parts += [f"## {situation}: competence\n", markdown(competence_table(own))]
    return "\n".join(parts)


def table2_csv(table: Table2) -> str:
    """One line per situation, method, task, set of episodes and run, and one for all runs.

    Rescues per episode and the score are those of all episodes, and in their lines only.
    """
    lines = []
    competence = {(part.situation, part.method): part for part in table.competence}
    for row in table.rows:
        beside = competence[row.situation, row.method]
        for sharing in (row.recorded, row.scored):
            means = {name: mean.mean if mean else None for name, mean in beside.mean.items()}
            labels = [*map(str, row.seeds), "all"]
            runs = zip(labels, (*sharing.each, sharing.all), (*beside.each, means), strict=True)
            for seed, run, values in runs:
                own = values if sharing is row.scored else {}
                lines.append(_line(row, seed, sharing, run, own))
    return csv_text(_COLUMNS.split(), lines)


def _line(
    row: Row,
    seed: str,
    sharing: Sharing,
    run: Evenness | EvennessOfRuns,
    values: Mapping[str, float | None],
) -> list[str | int | float | None]:
    share, chi, printed = run.share, run.chi_squared, row.printed
    return [
        *(row.situation, row.method, row.task, seed, sharing.episodes),
        *(*row.robots, *run.rescues),
        *((share.mean, share.low, share.high) if share else (None, None, None)),
        *(run.interval_90 or (None, None)),
        *((chi.statistic, chi.p) if chi else (None, None)),
        *(run.equivalence_p, run.verdict),
        *((printed.row.shares[0], printed.row.chi_squared) if printed else (None, None)),
        *(values.get("rescues_per_episode"), values.get("score")),
    ]


def sharing_summary(table: Table2, situation: str) -> Table:
    """How all methods share the tasks of one situation, over all episodes."""
    rows = [row for row in table.rows if row.situation == situation]
    printed = any(row.printed for row in rows)
    heads = [
        *columns(["method", "task"], ["rescues", "share of the first robot [95 %]"]),
        *columns(["verdict", "runs even / uneven / undecided"]),
        *columns([], ["share in the paper"] if printed else []),
    ]
    lines = []
    for row in rows:
        whole = row.scored.all
        cells = [row.method, row.task, f"{sum(whole.rescues):,}", share_shown(row.scored)]
        cells += [whole.verdict, verdicts_shown(row.scored)]
        if printed:
            cells.append(format_number(row.printed.row.shares[0]) if row.printed else NONE)
        lines.append(cells)
    return plain_table(heads, lines)


def _sharing_table(rows: Sequence[Row], name: str) -> Table:
    printed = any(row.printed for row in rows) and name == "recorded"
    heads = [
        *columns(["method", "task"], ["runs", "rescues (first + second)", "share [95 %]"]),
        *(Column("90 % interval"), Column("p (TOST)"), Column("verdict", right=False)),
        *columns(["runs even / uneven / undecided"], ["pooled share", "χ² (p)"]),
        *columns([], ["printed shares, χ²", "printed χ² at n = 100"] if printed else []),
    ]
    lines = []
    for row in rows:
        sharing: Sharing = getattr(row, name)
        first, second = sharing.all.rescues
        cells = [row.method, row.task, str(len(row.seeds))]
        cells += [f"{first + second} ({first} + {second})", share_shown(sharing)]
        cells += [*_tost(sharing.all), verdicts_shown(sharing)]
        cells += [format_estimate(sharing.together.pooled_share) if sharing.together else NONE]
        cells += [_chi_squared(sharing.all.chi_squared)]
        if printed and row.printed:
            shares, was = row.printed.row.shares, row.printed.row
            cells += [f"{shares[0]:.2f} / {shares[1]:.2f}, {was.chi_squared:.{was.decimals}f}"]
            cells += [f"{row.printed.chi_squared:.2f}"]
        elif printed:
            cells += [NONE, NONE]
        lines.append(cells)
    return plain_table(heads, lines)


def _runs_table(rows: Sequence[Row]) -> Table:
    heads = list(columns(["method", "task"], ["seed"]))
    for name in ("scored", "recorded"):
        episodes = _listed(sorted({getattr(row, name).episodes for row in rows}))
        numbers = [f"{episodes} episodes: rescues", "share [95 %]", "90 % interval", "p (TOST)"]
        heads += [*columns([], numbers), *columns(["verdict"], ["χ² (p)"])]
    lines = []
    for row in rows:
        for index, seed in enumerate(row.seeds):
            cells = [row.method, row.task, str(seed)]
            for sharing in (row.scored, row.recorded):
                run = sharing.each[index]
                cells += [f"{run.rescues[0]} + {run.rescues[1]}", format_estimate(run.share)]
                cells += [*_tost(run), _chi_squared(run.chi_squared)]
            lines.append(cells)
    return plain_table(heads, lines)


def _tost(found: Evenness | EvennessOfRuns) -> list[str]:
    """The interval that decides whether work is even, the p-value and the verdict."""
    ends = found.interval_90
    interval = f"[{format_number(ends[0])}, {format_number(ends[1])}]" if ends else NONE
    return [interval, format_p(found.equivalence_p), found.verdict]


def _chi_squared(found: ChiSquared | None) -> str:
    if found is None:
        return NONE
    verdict = ", rejected" if found.rejected else ""
    return f"{found.statistic:.2f} ({format_p(found.p)}){verdict}"


def _listed(values: Sequence[int]) -> str:
    return " or ".join(f"{value:,}" for value in values)
