"""The trials of a search: sets of values, each in a file of its own that appears whole."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import ConfigError, RunError
from innerattn.studies.folder import StudyFolder, copy_in
from innerattn.studies.ledger import made_alone
from innerattn.studies.plan import RECIPE, PlannedRun, plan_trial
from innerattn.studies.space import MOST_TRIALS, Search, Value

_FILE = re.compile(r"trial-([1-9][0-9]{0,5})\.json")


@dataclass(frozen=True, eq=False)
class Trial:
    """A set of values that a search tries.

    Attributes:
        number: in the order of the proposals; 0 is the grid as it is.
        values: by dotted key of a run; none of the grid as it is.
        runs: of all seeds of the study, those that confirm last; none if ``refused``.
        refused: why its values cannot be run together; None if they can.
    """

    number: int
    values: Mapping[str, Value]
    runs: Sequence[PlannedRun]
    refused: str | None = None

    @property
    def name(self) -> str:
        """What the study calls it."""
        return f"trial-{self.number}" if self.number else RECIPE

    def values_of(self, search: Search) -> dict[str, Value]:
        """Its values of the keys that a search draws; of the recipe those of its configuration."""
        if self.number or not self.runs:
            return dict(self.values)
        found = {}
        for key in search.space:
            value: Any = self.runs[0].config.digest_values()
            for word in key.split("."):
                value = value.get(word) if isinstance(value, Mapping) else None
            if isinstance(value, str | int | float | bool):
                found[key] = value
        return found

    def of_seed(self, seed: int) -> list[PlannedRun]:
        """Its runs with a seed, one for each scenario."""
        return [run for run in self.runs if run.seed == seed]


def plan(study: StudyFolder, number: int, values: Mapping[str, Value]) -> Trial:
    """A trial with its runs."""
    trial = Trial(number, values, ())
    try:
        runs = plan_trial(study.study, copy_in(study.path), trial.name, values)
    except ConfigError as error:
        return Trial(number, values, (), str(error))
    return Trial(number, values, runs)


def read_values(study: StudyFolder) -> dict[int, dict[str, Value]]:
    """The values of all trials by number, without those of the grid as it is.

    Raises:
        RunError: a file is damaged, or there are over 1,000.
        OSError: a file cannot be read.
    """
    folder = _folder(study)
    found: dict[int, dict[str, Value]] = {}
    for path in folder.iterdir() if folder.is_dir() else ():
        match = _FILE.fullmatch(path.name)
        if match is not None:
            found[int(match[1])] = _values_in(path)
        if len(found) > MOST_TRIALS:
            raise RunError(f"{folder}: holds too many trials: must be at most {MOST_TRIALS:,}")
    return dict(sorted(found.items()))


def add_values(study: StudyFolder, number: int, values: Mapping[str, Value]) -> bool:
    """Make the trial with that number; whether no other worker has made it.

    Raises:
        OSError: the file cannot be written.
    """
    folder = _folder(study)
    folder.mkdir(exist_ok=True)
    document: dict[str, Any] = {"schema_version": 1, "values": dict(values)}
    return made_alone(folder / f"trial-{number}.json", f"{json.dumps(document)}\n")


def _folder(study: StudyFolder) -> Path:
    return study.path / "search"


def _values_in(path: Path) -> dict[str, Value]:
    try:
        values = parse_json(read_plain(path, MOST_JSON_BYTES))["values"]
        if not all(isinstance(one, str | int | float | bool) for one in values.values()):
            raise ValueError("not values of a run")
        return dict(values)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: holds no trial of a search") from error
