"""The paper's claims about sharing beside what runs show; `claims.RULES` says how it is decided."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.paper.claims import (
    EVEN_WITH,
    MORE_EVEN,
    UNEVEN_WITHOUT,
    Claim,
    Holds,
    claim_about,
)
from innerattn.experiments.paper.pairs import Pair
from innerattn.experiments.paper.printed import PrintedRow
from innerattn.experiments.paper.table2 import Row, Sharing, Table2
from innerattn.measures.sharing.evenness import Verdict
from innerattn.stats import Estimate
from innerattn.stats.text import NONE, format_estimate, format_number, format_signed


def sharing_claims(table: Table2) -> list[Claim]:
    """Whether work is shared evenly with inner attention, and unevenly without."""
    rows: dict[tuple[str, str], list[Row]] = {}
    for row in table.rows:
        rows.setdefault((row.situation, row.method), []).append(row)
    compared = {
        (pair.situation, f"{pair.algorithm}-inner"): pair
        for pair in table.pairs
        if pair.measure == "imbalance"
    }
    claims = []
    for (situation, method), own in rows.items():
        if not method.endswith(("-inner", "-uniform")):
            continue
        verdicts = [judged(row) for row in own]
        inner = method.endswith("-inner")
        wanted, other = ("even", "uneven") if inner else ("uneven", "even")
        told = [row.printed.row.shares[0] for row in own if row.printed]
        claims.append(
            claim_about(
                own[0],
                EVEN_WITH if inner else UNEVEN_WITHOUT,
                (
                    "; ".join(filter(None, map(_printed_share, own))) or NONE,
                    ", ".join(map(format_number, told)) or NONE,
                ),
                "; ".join(map(_measured_share, own)),
                ", ".join(_share(row.scored) for row in own),
                _all_or_one(verdicts, wanted, other),
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
    return format_estimate(whole.share) if whole.share else _share(sharing)


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
    stated = row.printed.text_shares
    text = f" (in its text {stated[0]:.2f})" if stated else ""
    return f"{row.task} {row.printed.row.shares[0]:.2f}{text}"


def _measured_share(row: Row) -> str:
    return f"{row.task} {share_shown(row.scored)}, runs {verdicts_shown(row.scored)}"


def _share(sharing: Sharing) -> str:
    """The share of the first robot in all runs, without an interval."""
    whole, rescues = sharing.all, sum(sharing.all.rescues)
    if whole.share:
        return format_number(whole.share.mean)
    return format_number(whole.rescues[0] / rescues) if rescues else NONE


def _contrast(pair: Pair, inner: Sequence[Row], uniform: Sequence[Row]) -> Claim:
    holds: Holds = "undecided"
    measured, brief = f"imbalance {_mean(pair.inner)}, uniform {_mean(pair.uniform)}", NONE
    if pair.contrast is not None:
        difference = pair.contrast.difference
        measured += f"; difference {format_estimate(difference)}"
        brief = format_signed(difference.mean)
        if difference.high < 0.0:
            holds = "yes"
        elif difference.low > 0.0 or pair.contrast.equivalent:
            holds = "no"
    printed = [
        (row.task, _distance(row.printed.row), _distance(other.printed.row))
        for row, other in zip(inner, uniform, strict=True)
        if row.printed and other.printed
    ]
    gain = sum(with_ - without for _, with_, without in printed) / max(len(printed), 1)
    told = "; ".join(f"{task} {a:.2f}, uniform {b:.2f}" for task, a, b in printed) or NONE
    both = (told, format_signed(gain) if printed else NONE)
    return claim_about(inner[0], MORE_EVEN, both, measured, brief, holds, len(pair.seeds))


def _distance(printed: PrintedRow) -> float:
    return abs(printed.shares[0] - 0.5)


def _mean(value: Estimate | None) -> str:
    return f"{value.mean:.2f}" if value else NONE
