"""What is there of the runs that a study needs, and what may be used of it; it changes nothing."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from innerattn.config import RunConfig
from innerattn.errors import InnerattnError
from innerattn.experiments import archive
from innerattn.experiments.failures import read_failures
from innerattn.experiments.plan import PlannedRun
from innerattn.experiments.run import FinishedRun, NotMeasuredError, measured_run
from innerattn.records.run_files import AlteredFileError, RunFiles
from innerattn.records.run_folder import config_of

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
"""What is trained, from its newest checkpoint or from the beginning."""
_MOST_KEYS, _MOST_LETTERS = 3, 60


@dataclass(frozen=True)
class RunStatus:
    """What is at the place of a planned run.

    Attributes:
        planned: the run that a study needs.
        state: what there is of it.
        why: why it is not a finished run, if it is not.
        run: the finished run, if it is one.
    """

    planned: PlannedRun
    state: State
    why: str | None = None
    run: FinishedRun | None = None

    @property
    def reason(self) -> str:
        """The state, and why it is that."""
        name = self.state.replace("_", " ")
        return f"{name}: {self.why}" if self.why else name


def scan_runs(
    planned: Iterable[PlannedRun], out: Path, *, steps: bool = False, archived: bool = True
) -> list[RunStatus]:
    """What is there of each planned run of the study in ``out``; every file is read once.

    A run without a folder is taken from the study's archive, if that has it.

    Args:
        planned: the runs.
        out: folder of the study.
        steps: whether the runs' records are to hold what was recorded step by step.
        archived: whether archived runs do, which hold neither metrics nor steps.

    Raises:
        RunError: the study's list of failures or its archive is damaged.
    """
    failures = read_failures(out)
    path = out / archive.FILE
    kept = archive.read_archive(path) if os.path.lexists(path) else []
    by_name = {run.folder.name: run for run in kept}
    found = [
        _scan_folder(one, steps)
        if os.path.lexists(one.folder)
        else _scan_archive(one, by_name.get(one.folder.name), archived)
        for one in planned
    ]
    return [
        RunStatus(one.planned, "failed", failures[name])
        if one.state in TO_TRAIN and (name := one.planned.folder.name) in failures
        else one
        for one in found
    ]


def finished_runs(found: Iterable[RunStatus]) -> list[FinishedRun]:
    """The runs that can be used."""
    return [one.run for one in found if one.run is not None]


def differences(config: RunConfig, planned: RunConfig) -> list[str]:
    """Where ``config`` differs from what is planned: key, its value and the planned one.

    What counts is the values, not what a file spells out: a key that came later has its default.
    Numbers that the planned run does not look at do not count, nor does the device.
    """
    values, wanted = _flat(config.model_dump(mode="json")), _flat(planned.in_use())
    return [
        f"{key} = {_short(values[key])}, planned {_short(value)}"
        for key, value in wanted.items()
        if values[key] != value and key != "train.device"
    ]


def _scan_archive(planned: PlannedRun, run: FinishedRun | None, does: bool) -> RunStatus:
    if run is None:
        return RunStatus(planned, "missing")
    differing = differences(run.config, planned.config)
    if differing:
        return RunStatus(planned, "other_configuration", _some(differing))
    if not does:
        return RunStatus(planned, "unreadable", "archived, without metrics and steps")
    found = replace(run, case=planned.case, folder=planned.folder)
    return RunStatus(planned, "finished", run=found)


def _scan_folder(planned: PlannedRun, steps: bool) -> RunStatus:
    folder = planned.folder
    try:
        files = RunFiles(folder)
        info, config = files.info, config_of(files)
        differing = differences(config, planned.config)
        if differing:
            return RunStatus(planned, "other_configuration", _some(differing))
        if info.state != "done":
            return RunStatus(planned, "unfinished", f"its state is {info.state!r}")
        run = measured_run(planned.case, files, config, steps=steps)
    except NotMeasuredError as error:
        if not os.path.lexists(folder / "checkpoints"):
            return RunStatus(planned, "unreadable", f"it has no weights to measure, and {error}")
        altered = isinstance(error.__cause__, AlteredFileError)
        reason = str(error) if altered else "trained, but not measured as a whole"
        return RunStatus(planned, "unmeasured", reason)
    except (InnerattnError, OSError) as error:
        return RunStatus(planned, "unreadable", " ".join(str(error).split()))
    return RunStatus(planned, "finished", run=run)


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
