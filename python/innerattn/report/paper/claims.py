"""The paper's claims as tables: one row for each, and every one in full."""

from __future__ import annotations

from collections.abc import Sequence

from innerattn.experiments.paper.claims import CLAIMS, Claim
from innerattn.experiments.paper.table2 import PRINTED_SITUATION
from innerattn.report.table import Column, Table, columns, plain_table, section
from innerattn.stats.text import NONE


def claims_summary(claims: Sequence[Claim]) -> Table:
    """A row for each claim: what the paper prints, what was measured there, what holds where.

    A cell that names no algorithm is about all.
    """
    situations = _in_order(claims)
    first = situations[0]
    heads = columns(["claim", "paper", f"measured, {first}"])
    heads += columns([f"holds in {situation}?" for situation in situations])
    rows = []
    for name in CLAIMS:
        own = [claim for claim in claims if claim.claim == name]
        if not own:
            continue
        there = [claim for claim in own if claim.situation == first]
        cells = [name, _by_algorithm({claim.method: claim.printed_brief for claim in there})]
        cells.append(_by_algorithm({claim.method: claim.brief for claim in there}))
        for situation in situations:
            holds = {c.method: f"**{c.holds}**" for c in own if c.situation == situation}
            cells.append(_by_algorithm(holds))
        rows.append(cells)
    return plain_table(heads, rows)


def claims_table(claims: Sequence[Claim]) -> Table:
    """Every claim in full, by situation."""
    parts = [
        section(
            (
                [c.claim, c.method, c.printed, c.measured, str(c.runs), f"**{c.holds}**"]
                for c in claims
                if c.situation == situation
            ),
            situation,
        )
        for situation in _in_order(claims)
    ]
    heads = (
        *columns(["claim", "method", "paper", "measured"]),
        *(Column("runs"), Column("holds?", right=False)),
    )
    return Table(heads, tuple(parts))


def _in_order(claims: Sequence[Claim]) -> list[str]:
    """Situations, the one that the paper is taken to be about first."""
    situations = dict.fromkeys(claim.situation for claim in claims)
    return sorted(situations, key=lambda situation: situation != PRINTED_SITUATION)


def _by_algorithm(cells: dict[str, str]) -> str:
    """Cells by method as one; a single one where all are the same."""
    if not cells:
        return NONE
    if len(set(cells.values())) == 1:
        return next(iter(cells.values()))
    return "; ".join(f"{method.split('-')[0].upper()} {cell}" for method, cell in cells.items())
