"""Table II as values to compute with."""

from __future__ import annotations

from collections.abc import Mapping

from innerattn.experiments.paper.table2 import Row, Sharing, Table2
from innerattn.measures.sharing.evenness import Evenness, EvennessOfRuns
from innerattn.report.table import csv_text

_COLUMNS = """
situation method task seed episodes robot_0 robot_1 rescues_0 rescues_1 share_0 share_low share_high
share_low_90 share_high_90 chi_squared p equivalence_p verdict printed_share_0 printed_chi_squared
rescues_per_episode score
"""


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
