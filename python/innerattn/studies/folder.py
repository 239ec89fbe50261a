"""The folder of a study: its file as it was given, its ledger, and its rules over time."""

from __future__ import annotations

import datetime
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from innerattn.config.files import write_whole
from innerattn.config.untrusted import MOST_JSON_BYTES, MOST_TOML_BYTES, parse_json, read_plain
from innerattn.errors import RunError
from innerattn.studies.ledger import Ledger
from innerattn.studies.plan import PlannedRun, plan_study
from innerattn.studies.study import Study, study_in

_FILE, _RULES = "study.toml", "rules.json"


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
    """

    path: Path
    study: Study
    planned: list[PlannedRun]
    rules: tuple[Rules, ...]

    @property
    def runs(self) -> Path:
        """Folder of the finished runs."""
        return self.path / "runs"

    def ledger(self, silent_after_s: float | None = None) -> Ledger:
        """Its ledger."""
        return (
            Ledger(self.path)
            if silent_after_s is None
            else Ledger(self.path, silent_after_s=silent_after_s)
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
    return StudyFolder(path, study, plan_study(study, _copy_in(path)), _read_rules(path))


def begin_study(
    file: Path, path: Path, now: Callable[[], datetime.datetime] | None = None
) -> StudyFolder:
    """Begin a study in a folder, or go on with it, with the rules that a file has now.

    The folder holds copies of the file and of its scenarios. Every version of the rules is noted
    with its date and the number of runs that were finished then.

    Args:
        file: the study's file.
        path: the folder; it is made if needed.
        now: the time.

    Raises:
        ConfigError: the file cannot be read or is not valid; nothing was written then.
        RunError: the folder's record of rules is damaged.
        OSError: the folder cannot be written.
    """
    data = read_plain(file, MOST_TOML_BYTES, follow_link=True)
    study = study_in(data, file)
    planned = plan_study(study, file.parent.joinpath)
    rules = _read_rules(path)
    path.mkdir(parents=True, exist_ok=True)
    for scenario in study.grid.scenarios:
        if scenario.endswith(".toml"):
            copy = _copy_in(path)(scenario)
            copy.parent.mkdir(exist_ok=True)
            write_whole(copy, read_plain(file.parent / scenario, MOST_TOML_BYTES, follow_link=True))
    digest = study.digest()
    if not rules or rules[-1].digest != digest:
        states = Ledger(path).states(run.key for run in planned)
        date = (now or _utc)().isoformat(timespec="seconds")
        finished = sum(state == "done" for state in states.values())
        rules = (*rules, Rules(digest, date, finished))
        document = {"schema_version": 1, "rules": [vars(one) for one in rules]}
        write_whole(path / _RULES, f"{json.dumps(document, indent=1)}\n".encode())
    write_whole(path / _FILE, data)
    return StudyFolder(path, study, planned, rules)


def _copy_in(path: Path) -> Callable[[str], Path]:
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
