"""The paper's claims about sharing beside what runs show; `claims.RULES` says how it is decided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from innerattn.evaluate.comparison import contrast
from innerattn.evaluate.sharing.evenness import MARGIN, Verdict
from innerattn.evaluate.sharing.printed import TEXT, PrintedRow
from innerattn.study.claims import LEAST_PAIRS, Claim, Holds
from innerattn.study.table2 import Row, Table2
from innerattn.study.table2_text import NONE, share_shown, shown, verdicts_shown


def sharing_claims(table: Table2) -> list[Claim]:
    """Whether work is shared evenly with inner attention, and unevenly without."""
    rows: dict[tuple[str, str], list[Row]] = {}
    for row in table.rows:
        rows.setdefault((row.situation, row.method), []).append(row)
    claims = []
    for (situation, method), own in rows.items():
        if not method.endswith(("-inner", "-uniform")):
            continue
        verdicts = [judged(row) for row in own]
        inner = method.endswith("-inner")
        wanted, other = ("even", "uneven") if inner else ("uneven", "even")
        claims.append(
            Claim(
                claim="even sharing with inner attention" if inner else "uneven sharing without",
                situation=situation,
                method=method,
                printed="; ".join(filter(None, map(_printed_share, own))) or NONE,
                measured="; ".join(_measured_share(row) for row in own),
                runs=len(own[0].seeds),
                holds=_all_or_one(verdicts, wanted, other),
            )
        )
        without = rows.get((situation, method.replace("-inner", "-uniform")))
        if inner and without:
            claims.append(_contrast(own, without))
    return claims


def judged(row: Row) -> Verdict:
    """How a task is shared, over all episodes of all runs, by `RULES`."""
    verdicts, together = row.scored.verdicts(), row.scored.together
    if together is None:
        return "undecided"
    if together.verdict == "even" and not verdicts["uneven"]:
        return "even"
    many = 2 * verdicts["uneven"] > len(row.seeds)
    return "uneven" if many or together.verdict == "uneven" else "undecided"


def _all_or_one(verdicts: Sequence[Verdict], wanted: str, other: str) -> Holds:
    if all(verdict == wanted for verdict in verdicts):
        return "yes"
    return "no" if other in verdicts else "undecided"


def _printed_share(row: Row) -> str:
    if row.printed is None:
        return ""
    first, second = row.printed.row.shares
    stated = TEXT.get((row.method, row.task))
    text = f" (text: {stated[0]:.2f} / {stated[1]:.2f})" if stated else ""
    return f"{row.task}: {first:.2f} / {second:.2f}{text}"


def _measured_share(row: Row) -> str:
    return f"{row.task}: {share_shown(row.scored)}, runs {verdicts_shown(row.scored)}"


def _unevenness(rows: Sequence[Row]) -> dict[int, float]:
    """|share - 0.5| averaged over tasks, by the seed of each run that has rescues of every task."""
    by_run = zip(*(row.scored.each for row in rows), strict=True)
    shares = [[task.share.mean for task in run if task.share] for run in by_run]
    return {
        seed: float(np.mean(np.abs(np.array(run) - 0.5)))
        for seed, run in zip(rows[0].seeds, shares, strict=True)
        if len(run) == len(rows)
    }


def _contrast(inner: Sequence[Row], uniform: Sequence[Row]) -> Claim:
    ours, theirs = _unevenness(inner), _unevenness(uniform)
    seeds = sorted(ours.keys() & theirs.keys())
    with_, without = [ours[seed] for seed in seeds], [theirs[seed] for seed in seeds]
    pairs = np.stack([without, with_], 1)
    found = contrast(pairs, (1.0, -1.0), 0.5 - MARGIN[0]) if len(seeds) >= LEAST_PAIRS else None
    holds: Holds = "undecided"
    measured = f"distance from 0.5: {_mean(with_)} with, {_mean(without)} without"
    if found is not None:
        measured += f"; difference {shown(found.difference)}"
        if found.difference.low > 0.0:
            holds = "yes"
        elif found.difference.high < 0.0 or found.equivalent:
            holds = "no"
    printed = "; ".join(
        f"{row.task}: {_distance(row.printed.row)} with, {_distance(other.printed.row)} without"
        for row, other in zip(inner, uniform, strict=True)
        if row.printed and other.printed
    )
    return Claim(
        claim="more even with inner attention than without",
        situation=inner[0].situation,
        method=f"{inner[0].method}, {uniform[0].method}",
        printed=printed or NONE,
        measured=measured,
        runs=len(seeds),
        holds=holds,
    )


def _distance(printed: PrintedRow) -> str:
    return f"{abs(printed.shares[0] - 0.5):.2f}"


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f}" if values else NONE
