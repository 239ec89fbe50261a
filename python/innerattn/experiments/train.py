"""Trains and measures what a study lacks, as many runs at a time as there are cores."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from innerattn.experiments.failures import forget_failures, note_failure
from innerattn.experiments.lock import StudyLock
from innerattn.experiments.plan import PlannedRun
from innerattn.experiments.processes import places
from innerattn.experiments.scan import TO_TRAIN, RunStatus
from innerattn.experiments.side_by_side import Run, refuse_what_cannot_run, train_side_by_side


def to_train(found: Sequence[RunStatus]) -> list[PlannedRun]:
    """The runs that are to be trained and measured, in their order."""
    return [one.planned for one in found if one.state in TO_TRAIN]


def to_measure(found: Sequence[RunStatus]) -> list[PlannedRun]:
    """The runs that are trained and only to be measured, in their order."""
    return [one.planned for one in found if one.state == "unmeasured"]


def train_missing(
    found: Sequence[RunStatus],
    out: Path,
    lock: StudyLock,
    *,
    changed: Callable[[Sequence[Run]], None],
    failed: Callable[[PlannedRun, str], None],
    debug: bool = False,
) -> None:
    """Train and measure what is missing; what was stopped in training goes on where it was saved.

    A run that fails is written down and leaves the others alone; runs of other configurations and
    what cannot be read stay as they are.

    Args:
        found: what is there of each run.
        out: folder of the study.
        lock: that of ``out``; the processes of the runs hold it as well.
        changed: called with the runs that are trained when one of them is further.
        failed: called with each run that failed, and why.
        debug: let a process that fails show where.

    Raises:
        ConfigError: the configuration cannot be run here.
        OSError: a file or folder cannot be written or removed.
        KeyboardInterrupt: after every process has ended; finished runs stay.
    """
    measure, train = to_measure(found), to_train(found)
    if not measure and not train:
        return
    begun = {one.folder for one in train if _can_go_on(one.folder)}
    _remove([one.folder for one in train if one.folder not in begun])
    by_folder = {one.folder: one for one in (*measure, *train)}
    runs = [Run(one.config, one.folder, trained=True) for one in measure]
    runs += [Run(one.config, one.folder, begun=one.folder in begun) for one in train]
    refuse_what_cannot_run(runs)

    def note(run: Run) -> None:
        reason = run.failure or "no reason given"
        note_failure(out, by_folder[run.folder], reason)
        failed(by_folder[run.folder], reason)

    try:
        train_side_by_side(
            runs, places(len(runs)), changed=changed, failed=note, debug=debug, keep=lock
        )
    finally:
        forget_failures(out, [by_folder[run.folder] for run in runs if run.state == "done"])


def _can_go_on(folder: Path) -> bool:
    """Whether a run has a checkpoint that its training may go on from."""
    return any(folder.glob("checkpoints/*/checkpoint.json"))


def _remove(folders: Sequence[Path]) -> None:
    """Remove what is left of runs; a folder that is being removed never passes for a run."""
    leaving = [folder.with_name(f".{folder.name}.removed") for folder in folders]
    for folder, target in zip(folders, leaving, strict=True):
        if target.exists():
            shutil.rmtree(target)  # what an earlier study did not get to remove
        if folder.exists():
            folder.rename(target)
            shutil.rmtree(target)
