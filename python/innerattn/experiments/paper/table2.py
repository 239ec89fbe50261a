"""Table II over many runs: how evenly the two food robots share each task, and how well they do.

The paper does not say which situation its table is about. Its text speaks of "the typical task
variety scenario", and the mixed situation is the one that combines the other two; so the printed
rows stand beside mixed runs here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import RunError
from innerattn.experiments.paper.competence import Competence, competence, scripted_competence
from innerattn.experiments.paper.printed import CheckedRow, checked_table
from innerattn.experiments.run import FinishedRun
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

    def to_json(self) -> dict[str, Any]:
        """As a JSON object."""
        together = self.together.to_json() if self.together else None
        if together:
            del together["runs"]  # they stand in "each"
        each = [run.to_json() for run in self.each]
        return {"episodes": self.episodes, "each": each, "together": together}


@dataclass(frozen=True)
class Row:
    """One method's sharing of one task in one situation.

    Attributes:
        situation: of the worlds.
        method: of training.
        task: its name.
        robots: names of the first and the second robot.
        seeds: of the runs.
        recorded: over the episodes recorded step by step, as many as in the paper by default.
        scored: over all episodes of the standard length.
        printed: the paper's row; None where it has none.
    """

    situation: str
    method: str
    task: str
    robots: tuple[str, str]
    seeds: tuple[int, ...]
    recorded: Sharing
    scored: Sharing
    printed: CheckedRow | None

    def to_json(self) -> dict[str, Any]:
        """As a JSON object."""
        own = {name: getattr(self, name) for name in ("situation", "method", "task")}
        own |= {"robots": list(self.robots), "seeds": list(self.seeds)}
        own |= {"recorded": self.recorded.to_json(), "scored": self.scored.to_json()}
        return own | {"printed": asdict(self.printed) if self.printed else None}


@dataclass(frozen=True)
class Table2:
    """All rows, and beside evenness the competence of the same runs and of scripted policies."""

    rows: tuple[Row, ...]
    competence: tuple[Competence, ...]

    def to_json(self) -> dict[str, Any]:
        """The document of ``table2.json``."""
        return {
            "schema_version": SCHEMA_VERSION,
            "margin": list(MARGIN),
            "printed_situation": PRINTED_SITUATION,
            "rows": [row.to_json() for row in self.rows],
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
    return Table2(tuple(rows), tuple(beside))


def _counts(records: Sequence[Record]) -> dict[str, NDArray[np.int64]]:
    parts = [counts_by_episode(record) for record in records]
    return {task: np.concatenate([part[task] for part in parts]) for task in parts[0]}


def _sharing(counts: Sequence[NDArray[np.int64]]) -> Sharing:
    each = tuple(evenness(run) for run in counts)
    together = evenness_of_runs(counts, _SEED) if len(counts) > 1 else None
    return Sharing(len(counts[0]), each, together)
