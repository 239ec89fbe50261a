"""Table II over many runs: how evenly the two food robots share each task, and how well they do.

The paper does not say which situation its table is about. Its text speaks of "the typical task
variety scenario", and the mixed situation is the one that combines the other two; so the printed
rows stand beside mixed runs here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import RunError
from innerattn.experiments.paper.competence import Competence, competence, scripted_competence
from innerattn.experiments.paper.imbalance_score import (
    ImbalanceScoreCorrelation,
    imbalance_score_correlations,
)
from innerattn.experiments.paper.pairs import Pair, Together, pairs, together
from innerattn.experiments.paper.printed import CheckedRow, checked_table
from innerattn.experiments.run import FinishedRun, OfMethod
from innerattn.measures.cooperation import count_cooperation
from innerattn.measures.sharing.evenness import (
    MARGIN,
    Evenness,
    EvennessOfRuns,
    Verdict,
    counts_by_episode,
    evenness,
    evenness_of_runs,
)
from innerattn.records.record import Record
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 1

PRINTED_SITUATION = "mixed"
"""The situation that the paper's Table II, Fig. 4 and Fig. 5 are taken to be about."""

_SEED = 0  # of the bootstrap of pooled shares


@dataclass(frozen=True)
class Sharing:
    """How runs share one task.

    Attributes:
        episodes: of each run.
        each: each run by itself, in the order of the row's seeds.
        together: all runs; None of a single run.
    """

    episodes: int
    each: tuple[Evenness, ...]
    together: EvennessOfRuns | None

    @property
    def all(self) -> Evenness | EvennessOfRuns:
        """All runs together, or the only one."""
        return self.together or self.each[0]

    def verdicts(self) -> dict[Verdict, int]:
        """Number of runs by their own verdict."""
        names: tuple[Verdict, ...] = ("even", "uneven", "undecided")
        return {name: sum(run.verdict == name for run in self.each) for name in names}


@dataclass(frozen=True)
class Row(OfMethod):
    """One method's sharing of one task in one situation.

    Attributes:
        task: its name.
        robots: names of the first and the second robot.
        recorded: over the episodes recorded step by step, as many as in the paper by default.
        scored: over all episodes of the standard length.
        printed: the paper's row; None where it has none.
    """

    task: str
    robots: tuple[str, str]
    recorded: Sharing
    scored: Sharing
    printed: CheckedRow | None


@dataclass(frozen=True)
class Table2:
    """Table II, and what stands beside it: is attention, or evenness, any good?

    Attributes:
        rows: how runs share tasks.
        competence: of the same runs, and of scripted policies.
        pairs: learnt and uniform attention, seed by seed.
        together: the same over all situations.
        imbalance_score: how imbalance goes with the score.
    """

    rows: tuple[Row, ...]
    competence: tuple[Competence, ...]
    pairs: tuple[Pair, ...]
    together: tuple[Together, ...]
    imbalance_score: tuple[ImbalanceScoreCorrelation, ...]

    def to_json(self) -> dict[str, Any]:
        """The document of ``table2.json``."""
        rows = as_json(self.rows)
        for sharing in (row[name] for row in rows for name in ("recorded", "scored")):
            if sharing["together"] is not None:
                del sharing["together"]["runs"]  # they stand in "each"
        return {
            "schema_version": SCHEMA_VERSION,
            "margin": list(MARGIN),
            "printed_situation": PRINTED_SITUATION,
            "rows": rows,
            "competence": as_json(self.competence),
        }


def table2(groups: Sequence[Sequence[FinishedRun]]) -> Table2:
    """Table II.

    Args:
        groups: runs of one situation and method each, in order of seeds.

    Raises:
        RunError: a task is not one that two robots share.
    """
    printed = {(row.row.method, row.row.task): row for row in checked_table()}
    rows: list[Row] = []
    for group in groups:
        run, first = group[0], group[0].recorded
        helped = count_cooperation(first.rescues, first.scenario)
        shared = {task: list(robots) for task, robots in helped.items()}
        recorded = [counts_by_episode(measured.recorded) for measured in group]
        scored = [_counts(measured.scored) for measured in group]
        for task, able in shared.items():
            if len(able) != 2:
                raise RunError(
                    f"{run.folder}: {task} is shared by {len(able)} robots "
                    f"({', '.join(able) or 'none'}); Table II needs two"
                )
            known = printed.get((run.method, task))
            rows.append(
                Row(
                    situation=run.situation,
                    method=run.method,
                    task=task,
                    robots=(able[0], able[1]),
                    seeds=tuple(measured.seed for measured in group),
                    recorded=_sharing([counts[task] for counts in recorded]),
                    scored=_sharing([counts[task] for counts in scored]),
                    printed=known if run.situation == PRINTED_SITUATION else None,
                )
            )
    beside = [competence(group) for group in groups]
    for situation in dict.fromkeys(row.situation for row in rows):
        own = [group for group in groups if group[0].situation == situation]
        beside += scripted_competence(max(own, key=len))
    return Table2(
        rows=tuple(rows),
        competence=tuple(beside),
        pairs=tuple(pairs(beside)),
        together=tuple(together(beside)),
        imbalance_score=tuple(imbalance_score_correlations(beside)),
    )


def _counts(records: Sequence[Record]) -> dict[str, NDArray[np.int64]]:
    parts = [counts_by_episode(record) for record in records]
    return {task: np.concatenate([part[task] for part in parts]) for task in parts[0]}


def _sharing(counts: Sequence[NDArray[np.int64]]) -> Sharing:
    each = tuple(evenness(run) for run in counts)
    together = evenness_of_runs(counts, _SEED) if len(counts) > 1 else None
    return Sharing(len(counts[0]), each, together)
