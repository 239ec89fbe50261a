"""The folder of a study: its file as it was given, its ledger, and its rules over time."""

from __future__ import annotations

import datetime
import json
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import tomli_w

from innerattn.config import Scenario
from innerattn.config.files import toml_table_in, write_whole
from innerattn.config.scenario import scenario_table
from innerattn.config.untrusted import MOST_JSON_BYTES, MOST_TOML_BYTES, parse_json, read_plain
from innerattn.errors import InnerattnError, RunError
from innerattn.experiments import archive
from innerattn.experiments.run import FinishedRun
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of
from innerattn.studies.ledger import Ledger, State
from innerattn.studies.plan import PlannedRun, plan_study, run_digest
from innerattn.studies.study import Study, study_in

_OF_A_LEDGER = re.compile("-[0-9a-f]{16}$")
_FILE, _RULES, _POOL = "study.toml", "rules.json", "pool.json"


@dataclass(frozen=True)
class Rules:
    """A version of a study's file.

    Attributes:
        digest: of the study that it holds.
        date: when it was given, in UTC, to the second, by the clock of that machine.
        finished: how many runs were finished then.
    """

    digest: str
    date: str
    finished: int


@dataclass(frozen=True)
class StudyFolder:
    """A study that has begun.

    Attributes:
        path: its folder.
        study: what its file says.
        planned: its runs.
        rules: the versions of its file, the first one first.
        pool: the folder of its runs and its ledger, which it may share with other studies.
    """

    path: Path
    study: Study
    planned: list[PlannedRun]
    rules: tuple[Rules, ...]
    pool: Path

    @property
    def runs(self) -> Path:
        """Folder of the finished runs."""
        return self.pool / "runs"

    @property
    def keys(self) -> list[str]:
        """Names of its runs; a run of several places in the grid is one."""
        return list(dict.fromkeys(run.key for run in self.planned))

    @cached_property
    def archived(self) -> dict[str, FinishedRun]:
        """Finished runs of ``archive.parquet`` beside its runs, if there is one, by their keys.

        Raises:
            RunError: the archive is damaged.
        """
        path = self.pool / archive.FILE
        if not os.path.lexists(path):
            return {}
        by_digest = {run_digest(run.config): run for run in archive.read_archive(path)}
        return {run.key: by_digest[run.digest] for run in self.planned if run.digest in by_digest}

    @property
    def to_do(self) -> list[PlannedRun]:
        """Its runs that no archive has; one of each key."""
        first = {run.key: run for run in reversed(self.planned) if run.key not in self.archived}
        return list(reversed(first.values()))

    def take_over(self) -> list[Path]:
        """Let finished runs in ``runs`` that have other names be runs of the study.

        Such are runs of `innerattn train` that were put there, and those of version 0.1, which were
        named by their method and seed.

        Returns:
            Where they are now.

        Raises:
            OSError: the folder cannot be read, or a run in it cannot be renamed.
        """
        by_digest = {run.digest: run.key for run in self.planned}
        taken = []
        for folder in sorted(self.runs.iterdir()) if self.runs.is_dir() else ():
            summary = folder / "evaluation" / "summary.json"
            if _OF_A_LEDGER.search(folder.name) or not summary.exists():
                continue
            try:
                files = RunFiles(folder)
                key = by_digest.get(run_digest(config_of(files)))
            except InnerattnError:
                continue
            done = files.info.state == "done"
            if done and key is not None and not os.path.lexists(self.runs / key):
                taken.append(folder.rename(self.runs / key))
        return taken

    def states(self) -> dict[str, State]:
        """The state of each of its runs by key; those of an archive are done.

        Raises:
            OSError: the ledger cannot be read.
        """
        found = self.ledger().states(self.keys)
        return found | dict.fromkeys(self.archived, "done")

    def ledger(self, silent_after_s: float | None = None) -> Ledger:
        """Its ledger."""
        return (
            Ledger(self.pool)
            if silent_after_s is None
            else Ledger(self.pool, silent_after_s=silent_after_s)
        )


def open_study(path: Path) -> StudyFolder:
    """The study in a folder.

    Raises:
        RunError: there is none, or its record of rules is damaged.
        ConfigError: its file is not valid.
        OSError: a file cannot be read.
    """
    file = path / _FILE
    if not file.exists():
        raise RunError(f"{path}: holds no study; innerattn study run FILE.toml begins one")
    study = study_in(read_plain(file, MOST_TOML_BYTES), file)
    planned = plan_study(study, copy_in(path))
    return StudyFolder(path, study, planned, _read_rules(path), _read_pool(path))


def begin_study(
    file: Path,
    path: Path,
    now: Callable[[], datetime.datetime] | None = None,
    pool: Path | None = None,
) -> StudyFolder:
    """Begin a study in a folder, or go on with it, with the rules that a file has now.

    The folder holds copies of the file and of its scenarios. Every version of the rules is noted
    with its date and the number of runs that were finished then.

    Args:
        file: the study's file.
        path: the folder; it is made if needed.
        now: the time.
        pool: a folder whose runs it shares with other studies; None: as before, or its own folder.

    Raises:
        ConfigError: the file cannot be read or is not valid; nothing was written then.
        RunError: the folder's record of rules is damaged, or its runs are in another pool.
        OSError: the folder cannot be written.
    """
    return begin_study_in(
        read_plain(file, MOST_TOML_BYTES, follow_link=True), file, path, now=now, pool=pool
    )


def begin_study_in(
    data: bytes,
    file: Path,
    path: Path,
    *,
    now: Callable[[], datetime.datetime] | None = None,
    pool: Path | None = None,
) -> StudyFolder:
    """As `begin_study`, with the bytes of a file, which need not be there."""
    study = study_in(data, file)
    planned = plan_study(study, file.parent.joinpath)
    rules = _read_rules(path)
    begun = StudyFolder(path, study, planned, rules, _chosen_pool(path, pool))
    path.mkdir(parents=True, exist_ok=True)
    for scenario in {name for grid in study.grid for name in grid.scenarios}:
        if scenario.endswith(".toml"):
            copy = copy_in(path)(scenario)
            copy.parent.mkdir(exist_ok=True)
            write_whole(copy, _scenario_copy(file.parent / scenario))
    if begun.pool != path:
        where = os.path.relpath(begun.pool.resolve(), path.resolve())
        document: dict[str, Any] = {"schema_version": 1, "folder": where}
        write_whole(path / _POOL, f"{json.dumps(document)}\n".encode())
    digest = study.digest()
    if not rules or rules[-1].digest != digest:
        date = (now or _utc)().isoformat(timespec="seconds")
        finished = sum(state == "done" for state in begun.states().values())
        begun = replace(begun, rules=(*rules, Rules(digest, date, finished)))
        document = {"schema_version": 1, "rules": [vars(one) for one in begun.rules]}
        write_whole(path / _RULES, f"{json.dumps(document, indent=1)}\n".encode())
    write_whole(path / _FILE, data)
    return begun


def _scenario_copy(file: Path) -> bytes:
    """The bytes of a scenario's file; with the rows of its map in place of the map's file."""
    data = read_plain(file, MOST_TOML_BYTES, follow_link=True)
    table = scenario_table(file)
    given = toml_table_in(data, file)
    return data if table in (given, given.get(Scenario.place)) else tomli_w.dumps(table).encode()


def _chosen_pool(path: Path, pool: Path | None) -> Path:
    """The folder of a study's runs: as it is noted there, or as it is wanted."""
    known = _read_pool(path) if (path / _FILE).exists() else None
    if known is None or pool is None:
        return pool or known or path
    if known.resolve() != pool.resolve():
        raise RunError(f"{path}: its runs are in {known}: must be {pool}; choose another folder")
    return known


def _read_pool(path: Path) -> Path:
    file = path / _POOL
    if not os.path.lexists(file):
        return path
    try:
        document = parse_json(read_plain(file, MOST_JSON_BYTES))
        pool = Path(os.path.normpath(path / str(document["folder"])))
    except (ValueError, KeyError, TypeError) as error:
        raise RunError(f"{file}: does not name the folder of a study's runs") from error
    if not any((pool / name).is_dir() for name in ("runs", "claims")):
        raise RunError(f"{file}: names {pool}, which holds no runs of a study")
    return pool


def copy_in(path: Path) -> Callable[[str], Path]:
    """Where the folder of a study has its copy of a scenario's file."""
    return lambda scenario: path / "scenarios" / Path(scenario).name


def _utc() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


def _read_rules(path: Path) -> tuple[Rules, ...]:
    file = path / _RULES
    if not file.exists():
        return ()
    try:
        document: dict[str, Any] = parse_json(read_plain(file, MOST_JSON_BYTES))
        return tuple(
            Rules(str(one["digest"]), str(one["date"]), int(one["finished"]))
            for one in document["rules"]
        )
    except (ValueError, KeyError, TypeError) as error:
        raise RunError(f"{file}: not a record of a study's rules") from error
