"""Groups of runs under faults: measured once, kept as documents in the study's folder, and read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.config.files import write_whole
from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import RunError
from innerattn.experiments.plan import Case
from innerattn.experiments.processes import Job
from innerattn.experiments.robustness.design import Group, groups
from innerattn.experiments.robustness.documents import GroupResult, group_result
from innerattn.experiments.run import FinishedRun

FOLDER = "faults"
"""Holds the documents in a study's folder."""

_EVALUATING = 0.8
"""Part of a measurement that is retention; the rest is bounds and attention."""


@dataclass
class FaultMeasurement(Job):
    """A group of finished runs to be measured; its result is a file, which appears whole.

    Attributes:
        group: which runs meet which faults.
        folders: of the runs.
        path: the file.
    """

    group: Group
    folders: tuple[Path, ...]
    path: Path

    def __str__(self) -> str:
        return f"faults of {self.group.name}"

    def do(self, report: Callable[[float], None]) -> None:
        """Play the worlds, check the bounds, watch attention, and write the document."""
        from innerattn.evaluate.robustness import Stage, measure_robustness

        report(0.0)

        def progress(stage: Stage, done: int, total: int) -> None:
            report(_EVALUATING * done / total if stage == "evaluating" else _EVALUATING)

        measured = measure_robustness(
            self.folders,
            kinds=self.group.kinds,
            episodes=self.group.episodes,
            progress=progress,
        )
        text = json.dumps(measured.to_json(), indent=1, allow_nan=False)
        self.path.parent.mkdir(exist_ok=True)
        write_whole(self.path, f"{text}\n".encode())


def missing_measurements(
    planned: Sequence[Case], finished: Sequence[FinishedRun], out: Path
) -> list[FaultMeasurement]:
    """What is to be measured of the planned groups and has no document; nothing is read.

    A group is measured once all its runs are finished.

    Args:
        planned: all runs of the study.
        finished: those that are there.
        out: folder of the study.
    """
    runs = {run.case: run for run in finished}
    jobs = []
    for group in groups(planned):
        own = [runs[case] for case in group.cases if case in runs]
        if len(own) == len(group.cases) and not (path := _path(group, own, out)).exists():
            folders = tuple(run.folder for run in own)
            jobs.append(FaultMeasurement(group, folders, path))
    return jobs


def read_measurements(runs: Sequence[FinishedRun], out: Path) -> list[GroupResult]:
    """The results of the groups that are measured; each document is read once.

    Args:
        runs: the finished runs.
        out: folder of the study.

    Raises:
        RunError: a document is a link, damaged, or of another version.
    """
    by_case = {run.case: run for run in runs}
    measured = []
    for group in groups(by_case):
        path = _path(group, [by_case[case] for case in group.cases], out)
        if path.exists():
            try:
                document = parse_json(read_plain(path, MOST_JSON_BYTES))
                measured.append(group_result(group, document))
            except (OSError, ValueError, LookupError, TypeError) as error:
                reason = "not a measurement under faults of this version; remove it"
                raise RunError(f"{path}: {reason}") from error
    return measured


def _path(group: Group, runs: Sequence[FinishedRun], out: Path) -> Path:
    """The file of a group; its name ends with what tells these weights and faults from others."""
    weights = [run.weights_sha256 for run in runs]
    told = json.dumps([weights, group.kinds, group.episodes])
    return out / FOLDER / f"{group.name}-{hashlib.sha256(told.encode()).hexdigest()[:8]}.json"
