"""Which runs of a study failed and why, kept in its folder until they succeed."""

from __future__ import annotations

import json
from pathlib import Path

from innerattn.config.files import write_whole
from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import RunError
from innerattn.experiments.plan import PlannedRun

SCHEMA_VERSION = 1


def read_failures(out: Path) -> dict[str, str]:
    """Why runs of the study in ``out`` failed, by the name of their folder.

    Raises:
        RunError: ``failures.json`` is there but holds something else.
    """
    path = out / "failures.json"
    if not path.exists() and not path.is_symlink():
        return {}
    try:
        document = parse_json(read_plain(path, MOST_JSON_BYTES))
        if document["schema_version"] != SCHEMA_VERSION:
            raise ValueError
        return {str(one["folder"]): str(one["reason"]) for one in document["failures"]}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path}: not a list of failed runs; remove it") from error


def note_failure(out: Path, planned: PlannedRun, reason: str) -> None:
    """Write down that a run of the study in ``out`` failed.

    Raises:
        RunError: ``failures.json`` holds something else.
        OSError: it cannot be written.
    """
    _write(out, {**read_failures(out), planned.folder.name: reason})


def forget_failures(out: Path, planned: list[PlannedRun]) -> None:
    """Strike runs of the study in ``out`` off the list.

    Raises:
        RunError: ``failures.json`` holds something else.
        OSError: it cannot be written.
    """
    failures = read_failures(out)
    names = {one.folder.name for one in planned}
    if names & failures.keys():
        _write(out, {name: reason for name, reason in failures.items() if name not in names})


def _write(out: Path, failures: dict[str, str]) -> None:
    rows = [{"folder": name, "reason": reason} for name, reason in failures.items()]
    document = {"schema_version": SCHEMA_VERSION, "failures": rows}
    write_whole(out / "failures.json", f"{json.dumps(document, indent=1)}\n".encode())
