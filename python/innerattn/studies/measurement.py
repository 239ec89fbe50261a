"""What finished runs of a study are measured in beside their own evaluation.

Each run is measured once, in a file beside the runs, whose content the archive of a study keeps.
"""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from innerattn.config.files import write_whole
from innerattn.config.run import digest_of
from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import RunError
from innerattn.experiments.processes import Job
from innerattn.studies.folder import StudyFolder
from innerattn.studies.plan import PlannedRun


@dataclass
class Measurement(Job):
    """A finished run that is to be measured; its result is a file, which appears whole.

    Attributes:
        section: of the study that asks for it, which the folder of its files is called as well.
        values_key: under which its file has the measures.
        damaged: what a file is said to be none of.
        run: which one.
        folder: of the run.
        path: the file.
    """

    section: ClassVar[str]
    values_key: ClassVar[str] = "values"
    damaged: ClassVar[str]

    run: PlannedRun
    folder: Path
    path: Path

    def __str__(self) -> str:
        return f"{self.section.replace('_', ' ')} of {self.run}"

    @abstractmethod
    def measured(self, report: Callable[[float], None]) -> dict[str, Any]:
        """Play the worlds: the parts of the file's document, among them the measures."""

    def do(self, report: Callable[[float], None]) -> None:
        """Measure, and write the file."""
        report(0.0)
        document = {"schema_version": 1, "run": self.run.key, **self.measured(report)}
        self.path.parent.mkdir(exist_ok=True)
        write_whole(self.path, f"{json.dumps(document, indent=1, allow_nan=False)}\n".encode())

    @classmethod
    @abstractmethod
    def of(cls, study: StudyFolder, run: PlannedRun) -> Self | None:
        """That of a run; None where the study does not ask for it."""

    @classmethod
    def file(cls, study: StudyFolder, run: PlannedRun, rules: Mapping[str, Any]) -> Path:
        """Where the result is that follows from some rules."""
        return study.path / cls.section / f"{run.key}-{digest_of(dict(rules))[:8]}.json"

    @property
    def name(self) -> str:
        """Its file, in the folder of the study."""
        return f"{self.section}/{self.path.name}"

    def document(self, study: StudyFolder) -> dict[str, Any] | None:
        """What was found, from its file or else from the study's archive; None: nothing yet.

        Raises:
            RunError: it is damaged.
            OSError: the file cannot be read.
        """
        archived = study.archived.get(self.run.key)
        try:
            if self.path.exists():
                document = parse_json(read_plain(self.path, MOST_JSON_BYTES))
            elif archived is not None and self.name in archived.beside:
                document = archived.beside[self.name]
            else:
                return None
            return self.checked(document)
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            raise RunError(f"{self.path}: not {self.damaged}; remove it") from error

    def checked(self, document: Any) -> dict[str, Any]:
        """A document of this measurement.

        Raises:
            ValueError: it is none; or any error of taking it for one.
        """
        if document["run"] != self.run.key:
            raise ValueError("of another run")
        self.values_in(document)
        return dict(document)

    def values_in(self, document: Mapping[str, Any]) -> dict[str, float | None]:
        """The measures in a document."""
        found = document[self.values_key].items()
        return {str(name): None if value is None else float(value) for name, value in found}
