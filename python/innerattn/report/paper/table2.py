"""Table II as text: Markdown tables to read and one CSV to compute with."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence

from innerattn.experiments.paper.competence import Competence, competence_units
from innerattn.experiments.paper.sharing_claims import share_shown, verdicts_shown
from innerattn.experiments.paper.table2 import Row, Sharing, Table2
from innerattn.measures.sharing.evenness import MARGIN, ChiSquared, Evenness, EvennessOfRuns
from innerattn.policies import SCRIPTED
from innerattn.stats import Estimate
from innerattn.stats.text import NONE, format_estimate, format_number, format_p

_CSV_COLUMNS = """
situation method task seed episodes robot_0 robot_1 rescues_0 rescues_1 share_0 share_low share_high
share_low_90 share_high_90 chi_squared p equivalence_p verdict printed_share_0 printed_chi_squared
rescues_per_episode score
"""


def table2_markdown(table: Table2) -> str:
    """Tables by situation: sharing over all episodes, then as in the paper, runs, competence."""
    low, high = MARGIN
    parts = [
        "Shares are of rescues in which the first food robot helped. Over several runs the "
        "interval is Student's 95 % with the run as the unit, of a single run it is over its "
        "episodes, as is that of 90 %. Verdict: even where the 90 % interval lies within "
        f"{low} to {high} (two one-sided tests at 5 %), uneven where the 95 % interval lies "
        "outside, else undecided. χ² is that of the rescues of all runs added up, as if they were "
        "independent, and rejects at 5 %; it and a mean near 0.5 can hide runs that are uneven in "
        "opposite ways, so runs are counted by their own verdict, too. The share of all rescues "
        "has the interval of a bootstrap of runs and of episodes within, which is too short for "
        "few runs; p (TOST) is the larger of the two one-sided p-values.\n"
    ]
    for situation in dict.fromkeys(row.situation for row in table.rows):
        rows = [row for row in table.rows if row.situation == situation]
        scores = {c.method: c.mean["score"] for c in table.competence if c.situation == situation}
        parts.append(f"### Sharing, {situation}\n")
        for name in ("scored", "recorded"):
            episodes = sorted({getattr(row, name).episodes for row in rows})
            like = ", as in the paper" if name == "recorded" and episodes == [80] else ""
            parts.append(f"Over {_listed(episodes)} episodes of each run{like}:\n")
            parts.append(_sharing_table(rows, name, scores))
        parts.append("Every run:\n")
        parts.append(_runs_table(rows))
        parts.append(f"### Competence, {situation}\n")
        parts.append(
            "Choices and times of runs are those of the episodes recorded step by step. Last stand "
            "scripted policies in the same worlds, with choices and times of all episodes.\n"
        )
        parts.append(_competence_table([c for c in table.competence if c.situation == situation]))
    return "\n".join(parts)


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table that ends with a line break; bars in cells are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    escaped = ([cell.replace("|", "\\|") for cell in cells] for cells in lines)
    return "".join(f"| {' | '.join(cells)} |\n" for cells in escaped)


def table2_csv(table: Table2) -> str:
    """One line per situation, method, task, set of episodes and run, and one for all runs.

    Rescues per episode and the score are those of all episodes, and in their lines only.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_CSV_COLUMNS.split())
    competence = {(part.situation, part.method): part for part in table.competence}
    for row in table.rows:
        beside = competence[row.situation, row.method]
        for sharing in (row.recorded, row.scored):
            means = {name: mean.mean if mean else None for name, mean in beside.mean.items()}
            labels = [*map(str, row.seeds), "all"]
            runs = zip(labels, (*sharing.each, sharing.all), (*beside.each, means), strict=True)
            for seed, run, figures in runs:
                own = figures if sharing is row.scored else {}
                writer.writerow(_csv_line(row, seed, sharing, run, own))
    return text.getvalue()


def _csv_line(
    row: Row,
    seed: str,
    sharing: Sharing,
    run: Evenness | EvennessOfRuns,
    figures: Mapping[str, float | None],
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
        *(figures.get("rescues_per_episode"), figures.get("score")),
    ]


def _sharing_table(rows: Sequence[Row], name: str, scores: dict[str, Estimate | None]) -> str:
    head = ["method", "task", "seeds", "rescues (first + second)", "share of the first [95 %]"]
    head += ["[90 %]", "p (TOST)", "verdict on the mean", "runs even / uneven / undecided"]
    head += ["share of all rescues [bootstrap]", "χ² (p)"]
    head += ["score [95 %]"] if name == "scored" else []
    printed = any(row.printed for row in rows) and name == "recorded"
    head += ["printed shares, χ²", "printed χ² at n = 100"] if printed else []
    lines = []
    for row in rows:
        sharing: Sharing = getattr(row, name)
        first, second = sharing.all.rescues
        cells = [row.method, row.task, str(len(row.seeds))]
        cells += [f"{first + second} ({first} + {second})", share_shown(sharing)]
        cells += _tost(sharing.all)
        cells += [verdicts_shown(sharing)]
        cells += [format_estimate(sharing.together.pooled_share) if sharing.together else NONE]
        cells += [_chi_squared(sharing.all.chi_squared)]
        cells += [format_estimate(scores[row.method])] if name == "scored" else []
        if printed and row.printed:
            shares, was = row.printed.row.shares, row.printed.row
            cells += [f"{shares[0]:.2f} / {shares[1]:.2f}, {was.chi_squared:.{was.decimals}f}"]
            cells += [f"{row.printed.chi_squared:.2f}"]
        elif printed:
            cells += [NONE, NONE]
        lines.append(cells)
    return markdown_table(head, lines)


def _runs_table(rows: Sequence[Row]) -> str:
    head = ["method", "task", "seed"]
    for name in ("scored", "recorded"):
        episodes = _listed(sorted({getattr(row, name).episodes for row in rows}))
        head += [f"{episodes} episodes: rescues", "share [95 %]"]
        head += ["[90 %]", "p (TOST)", "verdict", "χ² (p)"]
    lines = []
    for row in rows:
        for index, seed in enumerate(row.seeds):
            cells = [row.method, row.task, str(seed)]
            for sharing in (row.scored, row.recorded):
                run = sharing.each[index]
                cells += [f"{run.rescues[0]} + {run.rescues[1]}", format_estimate(run.share)]
                cells += [*_tost(run), _chi_squared(run.chi_squared)]
            lines.append(cells)
    return markdown_table(head, lines)


def _competence_table(parts: Sequence[Competence]) -> str:
    head = ["method", "seed"]
    for name, unit in competence_units().items():
        words = name.removesuffix("_s").replace("_", " ")
        head.append(f"{words} ({unit})" if unit else words)
    lines = []
    for part in parts:
        played = part.method in SCRIPTED
        for seed, figures in zip(part.seeds, part.each, strict=True):
            if played and len(part.seeds) > 1:
                continue  # a policy that learns nothing differs by its worlds alone
            values = [figures[name] for name in competence_units()]
            shown_ = [NONE if value is None else format_number(value) for value in values]
            lines.append([part.method, str(seed), *shown_])
        if len(part.seeds) > 1:
            means = [format_estimate(part.mean[name]) for name in competence_units()]
            lines.append([part.method, "mean [95 %]", *means])
    return markdown_table(head, lines)


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
