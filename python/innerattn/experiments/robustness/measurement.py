"""Groups of runs under faults: measured once, and kept as documents in the study's folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.config.files import write_whole
from innerattn.experiments.plan import Case
from innerattn.experiments.processes import Job
from innerattn.experiments.robustness.design import Group, groups
from innerattn.experiments.run import FinishedRun

FOLDER = "faults"
"""Holds the documents in a study's folder."""

_EVALUATING = 0.8
"""Part of a measurement that is retention; the rest is bounds and attention."""


@dataclass
class FaultMeasurement(Job):
    """A group of finished runs; its result is a file, which appears whole.

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


def measurements(
    planned: Iterable[Case], finished: Sequence[FinishedRun], out: Path
) -> list[FaultMeasurement]:
    """What is or can be measured: the planned groups all whose runs are finished.

    The name of a file ends with what tells its weights and faults from others.

    Args:
        planned: runs of the study.
        finished: those that are there.
        out: folder of the study.
    """
    runs = {run.case: run for run in finished}
    found = []
    for group in groups([*planned]):
        own = [runs[case] for case in group.cases if case in runs]
        if len(own) == len(group.cases):
            told = json.dumps([[run.weights_sha256 for run in own], group.kinds, group.episodes])
            digest = hashlib.sha256(told.encode()).hexdigest()[:8]
            path = out / FOLDER / f"{group.name}-{digest}.json"
            found.append(FaultMeasurement(group, tuple(run.folder for run in own), path))
    return found


def missing_measurements(
    planned: Sequence[Case], finished: Sequence[FinishedRun], out: Path
) -> list[FaultMeasurement]:
    """Those of the `measurements` that have no document; nothing is read."""
    return [one for one in measurements(planned, finished, out) if not one.path.exists()]
