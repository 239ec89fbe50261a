"""Finished runs of a study under faults: each is measured once, in a file beside the runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from innerattn.config.files import write_whole
from innerattn.config.run import digest_of
from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import RunError
from innerattn.experiments.processes import Job
from innerattn.studies.folder import StudyFolder
from innerattn.studies.plan import PlannedRun
from innerattn.studies.study import RETAINED, Faults


@dataclass
class RunUnderFaults(Job):
    """A finished run that is to meet faults; its result is a file, which appears whole.

    Attributes:
        run: which one.
        folder: of the run.
        faults: which ones it meets.
        path: the file.
    """

    run: PlannedRun
    folder: Path
    faults: Faults
    path: Path

    def __str__(self) -> str:
        return f"faults of {self.run}"

    def do(self, report: Callable[[float], None]) -> None:
        """Play the worlds and write what is retained."""
        from innerattn.evaluate.faults.grid import Grid, play_all
        from innerattn.evaluate.trained import load_trained

        report(0.0)
        config = self.run.config
        steps = 2 * config.scenario.episode_steps
        worlds = config.scenario.replace(episode_steps=steps, faults=())
        grid = Grid(
            worlds, self.faults.kinds, episodes=self.faults.episodes, seed=config.evaluate.seed
        )
        _, policy = load_trained(self.folder, worlds)
        retention = play_all(
            [("run", policy)],
            grid,
            num_threads=config.train.threads,
            progress=lambda done, total: report(done / total),
        )["run"]
        each = retention.by_kind()
        values = {kind: _finite(each[k].value) for k, kind in enumerate(grid.kinds)}
        known = [value for value in values.values() if value is not None]
        whole = sum(known) / len(known) if len(known) == len(values) else None
        document: dict[str, Any] = {
            "schema_version": 1,
            "run": self.run.key,
            "episodes": grid.episodes,
            "episode_steps": steps,
            "retained": {RETAINED: whole}
            | {f"{RETAINED}_{kind}": value for kind, value in values.items()},
        }
        self.path.parent.mkdir(exist_ok=True)
        write_whole(self.path, f"{json.dumps(document, indent=1, allow_nan=False)}\n".encode())


def to_measure(study: StudyFolder) -> list[RunUnderFaults]:
    """The finished runs that have not met the faults of a study; nothing is read.

    Archived runs have no weights, so they cannot.
    """
    faults = study.study.faults
    if faults is None:
        return []
    first = {run.key: run for run in reversed(study.planned) if (study.runs / run.key).exists()}
    jobs = [
        RunUnderFaults(run, study.runs / key, faults, _path(study, faults, key))
        for key, run in reversed(first.items())
    ]
    return [job for job in jobs if not job.path.exists()]


def retained(study: StudyFolder, run: PlannedRun) -> Mapping[str, float | None]:
    """What a run retains, by measure; empty where it has not met the faults.

    Raises:
        RunError: its file is damaged.
        OSError: its file cannot be read.
    """
    faults = study.study.faults
    if faults is None or not (path := _path(study, faults, run.key)).exists():
        return {}
    try:
        document = parse_json(read_plain(path, MOST_JSON_BYTES))
        if document["run"] != run.key:
            raise ValueError("of another run")
        values = document["retained"].items()
        return {str(name): None if value is None else float(value) for name, value in values}
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: not a measurement under faults; remove it") from error


def _path(study: StudyFolder, faults: Faults, key: str) -> Path:
    told = digest_of({"kinds": list(faults.kinds), "episodes": faults.episodes})
    return study.path / "faults" / f"{key}-{told[:8]}.json"


def _finite(value: Any) -> float | None:
    number = float(value)
    return number if abs(number) < float("inf") else None
