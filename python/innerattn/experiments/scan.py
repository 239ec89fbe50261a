"""What is there of the runs that a study needs, and what may be used of it; it changes nothing."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from innerattn.config import RunConfig, read_toml
from innerattn.errors import InnerattnError
from innerattn.experiments.failures import read_failures
from innerattn.experiments.plan import Case, PlannedRun
from innerattn.experiments.run import digests
from innerattn.experiments.scores import NotMeasuredError, read_scores
from innerattn.records.run_folder import plain_file, read_info

State = Literal[
    "missing",
    "unfinished",
    "failed",
    "unmeasured",
    "finished",
    "other_configuration",
    "unreadable",
]
"""``failed``: an earlier try ended with an error; ``unmeasured``: trained to the end, without a
whole evaluation. A folder of one of the last two states is neither used nor changed."""

TO_TRAIN: frozenset[State] = frozenset({"missing", "unfinished", "failed"})
"""What is trained, from the beginning."""
_MOST_KEYS, _MOST_LETTERS = 3, 60


@dataclass(frozen=True)
class RunStatus:
    """What is at the place of a planned run, and why it is not a finished run, if it is not."""

    planned: PlannedRun
    state: State
    why: str | None = None


@dataclass(frozen=True)
class FinishedRun:
    """A run of a study that tables and figures may use.

    Attributes:
        case: which one it is.
        folder: the run folder; its ``evaluation`` is whole.
    """

    case: Case
    folder: Path


def scan_runs(planned: Iterable[PlannedRun], out: Path, *, whole: bool = False) -> list[RunStatus]:
    """What is there of each planned run of the study in ``out``.

    Args:
        planned: the runs.
        out: folder of the study.
        whole: whether metrics and steps are needed, so that small copies of runs do not do.

    Raises:
        RunError: the study's list of failures is damaged.
    """
    failures = read_failures(out)
    found = [_find(one, whole) for one in planned]
    return [
        RunStatus(one.planned, "failed", failures[name])
        if one.state in TO_TRAIN and (name := one.planned.folder.name) in failures
        else one
        for one in found
    ]


def finished_runs(found: Iterable[RunStatus]) -> list[FinishedRun]:
    """The runs that can be used."""
    return [
        FinishedRun(one.planned.case, one.planned.folder)
        for one in found
        if one.state == "finished"
    ]


def differences(config: RunConfig, planned: RunConfig) -> list[str]:
    """Where ``config`` differs from what is planned: key, its value and the planned one.

    What counts is the values, not what a file spells out: a key that came later has its default.
    Numbers that the planned run does not look at do not count.
    """
    values, wanted = _flat(config.model_dump(mode="json")), _flat(planned.in_use())
    return [
        f"{key} = {_short(values[key])}, planned {_short(value)}"
        for key, value in wanted.items()
        if values[key] != value
    ]


def _find(planned: PlannedRun, whole: bool) -> RunStatus:
    folder = planned.folder
    if not os.path.lexists(folder):
        return RunStatus(planned, "missing")
    if folder.is_symlink():
        return RunStatus(planned, "unreadable", "a link: must be a run folder")
    try:
        info = read_info(folder)
        config = read_toml(plain_file(folder / "config.toml"))
        differing = differences(config, planned.config)
        if differing:
            return RunStatus(planned, "other_configuration", _some(differing))
        if info.state != "done":
            return RunStatus(planned, "unfinished", f"its state is {info.state!r}")
        digests(folder)
        read_scores(folder, config)
    except NotMeasuredError as error:
        if not os.path.lexists(folder / "checkpoints"):
            return RunStatus(planned, "unreadable", f"kept without its weights, and {error}")
        return RunStatus(planned, "unmeasured", "trained, but not measured as a whole")
    except (InnerattnError, OSError) as error:
        return RunStatus(planned, "unreadable", " ".join(str(error).split()))
    if whole and not os.path.lexists(folder / "checkpoints"):
        return RunStatus(planned, "unreadable", "a small copy of a run, without metrics and steps")
    return RunStatus(planned, "finished")


def _flat(table: Mapping[str, Any]) -> dict[str, Any]:
    """Values by dotted key."""
    return {
        f"{section}.{key}": value for section, part in table.items() for key, value in part.items()
    }


def _some(differing: Sequence[str]) -> str:
    more = len(differing) - _MOST_KEYS
    return "; ".join(differing[:_MOST_KEYS]) + (f"; and {more} more" if more > 0 else "")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _MOST_LETTERS else f"{text[:_MOST_LETTERS]}..."
