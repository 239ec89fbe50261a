"""The paper's claims about sharing beside what runs show; `claims.RULES` says how it is decided."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.paper.claims import Claim, Holds
from innerattn.experiments.paper.pairs import Pair, pairs
from innerattn.experiments.paper.printed import TEXT, PrintedRow
from innerattn.experiments.paper.table2 import Row, Sharing, Table2
from innerattn.measures.sharing.evenness import Verdict
from innerattn.stats import Estimate
from innerattn.stats.text import NONE, format_estimate


def sharing_claims(table: Table2) -> list[Claim]:
    """Whether work is shared evenly with inner attention, and unevenly without."""
    rows: dict[tuple[str, str], list[Row]] = {}
    for row in table.rows:
        rows.setdefault((row.situation, row.method), []).append(row)
    compared = {
        (pair.situation, f"{pair.algorithm}-inner"): pair
        for pair in pairs(table.competence)
        if pair.measure == "imbalance"
    }
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
        pair = compared.get((situation, method))
        if pair is not None:
            uniform = rows[situation, f"{pair.algorithm}-uniform"]
            claims.append(_contrast(pair, own, uniform))
    return claims


def judged(row: Row) -> Verdict:
    """How a task is shared, over all episodes of all runs, by `RULES`."""
    verdicts, together = row.scored.verdicts(), row.scored.together
    if together is None or any(run.share is None for run in row.scored.each):
        return "undecided"
    if together.verdict == "even" and not verdicts["uneven"]:
        return "even"
    many = 2 * verdicts["uneven"] > len(row.seeds)
    return "uneven" if many or together.verdict == "uneven" else "undecided"


def share_shown(sharing: Sharing) -> str:
    """The share of the first robot in all runs; without an interval where it has none."""
    whole = sharing.all
    if whole.share is not None or not sum(whole.rescues):
        return format_estimate(whole.share)
    return f"{whole.rescues[0] / sum(whole.rescues):.2f}"


def verdicts_shown(sharing: Sharing) -> str:
    """Numbers of runs that are even, uneven and undecided by themselves."""
    return " / ".join(str(count) for count in sharing.verdicts().values())


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


def _contrast(pair: Pair, inner: Sequence[Row], uniform: Sequence[Row]) -> Claim:
    holds: Holds = "undecided"
    measured = f"distance from 0.5: {_mean(pair.inner)} with, {_mean(pair.uniform)} without"
    if pair.contrast is not None:
        measured += f"; difference {format_estimate(pair.contrast.difference)}"
        if pair.contrast.difference.high < 0.0:
            holds = "yes"
        elif pair.contrast.difference.low > 0.0 or pair.contrast.equivalent:
            holds = "no"
    printed = "; ".join(
        f"{row.task}: {_distance(row.printed.row)} with, {_distance(other.printed.row)} without"
        for row, other in zip(inner, uniform, strict=True)
        if row.printed and other.printed
    )
    return Claim(
        claim="more even with inner attention than without",
        situation=pair.situation,
        method=f"{inner[0].method}, {uniform[0].method}",
        printed=printed or NONE,
        measured=measured,
        runs=len(pair.seeds),
        holds=holds,
    )


def _distance(printed: PrintedRow) -> str:
    return f"{abs(printed.shares[0] - 0.5):.2f}"


def _mean(value: Estimate | None) -> str:
    return f"{value.mean:.2f}" if value else NONE
