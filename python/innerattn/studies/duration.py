"""How long the runs of a study take, and what is left, by the times of files in its folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from innerattn.studies.ledger import State

_SAMPLE = 200


@dataclass(frozen=True)
class Duration:
    """How long a study takes.

    Attributes:
        run_s: median time from the first claim of a finished run to the end of its evaluation [s];
            pauses of runs that were stopped count, too.
        left_s: what is left at the pace of the workers that are at work, or of one [s].
        workers: that are at work.
    """

    run_s: float
    left_s: float
    workers: int


def duration_of(folder: Path, states: Mapping[str, State], left: int) -> Duration | None:
    """How long the runs of the study in a folder take; None before the first one is finished.

    Args:
        folder: of the study's runs and claims.
        states: of its runs.
        left: how many runs have no result and have not failed.
    """
    took = []
    for key in [key for key, state in states.items() if state == "done"][-_SAMPLE:]:
        with suppress(OSError):  # taken away in between
            end = (folder / "runs" / key / "evaluation" / "summary.json").stat().st_mtime
            took.append(max(0.0, end - (folder / "claims" / f"{key}.1").stat().st_mtime))
    if not took:
        return None
    counts, run_s = Counter(states.values()), median(took)
    runs = left - counts["claimed"] / 2.0
    return Duration(run_s, run_s * runs / max(1, counts["claimed"]), counts["claimed"])


def in_words(seconds: float) -> str:
    """A time as "40 s", "25 min", "3.5 h" or "2.1 days"."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 5_400.0:
        return f"{seconds / 60.0:.0f} min"
    if seconds < 172_800.0:
        return f"{seconds / 3_600.0:.1f} h"
    return f"{seconds / 86_400.0:.1f} days"
