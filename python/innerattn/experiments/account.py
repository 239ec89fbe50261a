"""The study's own account of its runs, ``runs.json``: where each came from and what it found."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from innerattn.config.files import write_whole
from innerattn.experiments.scan import RunStatus
from innerattn.experiments.smoke import smoke_note

SCHEMA_VERSION = 1


def write_account(
    out: Path, target: str, budget: str, found: Sequence[RunStatus], outputs: Sequence[Path] = ()
) -> Path:
    """Write ``runs.json`` into the folder of a study; it appears whole or not at all.

    Args:
        out: the folder.
        target: what was asked for.
        budget: name of the built-in budget.
        found: what is there of each planned run.
        outputs: the files that were made of the runs.

    Returns:
        The file.

    Raises:
        OSError: the file cannot be written.
    """
    cases = [one.planned.case for one in found]
    document = {
        "schema_version": SCHEMA_VERSION,
        "note": smoke_note(budget),
        "target": target,
        "budget": budget,
        "methods": list(dict.fromkeys(case.method for case in cases)),
        "situations": list(dict.fromkeys(case.situation for case in cases)),
        "seeds": sorted({case.seed for case in cases}),
        "outputs": [str(path.relative_to(out)) for path in outputs],
        "runs": [_row(out, one) for one in found],
    }
    text = json.dumps(document, indent=1, allow_nan=False)
    write_whole(out / "runs.json", f"{text}\n".encode())
    return out / "runs.json"


def _row(out: Path, found: RunStatus) -> dict[str, Any]:
    planned = found.planned
    row = {
        **asdict(planned.case),
        "folder": planned.folder.relative_to(out).as_posix(),
        "state": found.state,
        "why": found.why,
    }
    if found.run is None:
        return row
    standard, long = found.run.scores()
    return row | {
        **asdict(standard),
        "long": asdict(long),
        "config_sha256": found.run.config_sha256,
        "weights_sha256": found.run.weights_sha256,
        "commit": found.run.info.commit,
        "device": found.run.info.device,
        "versions": found.run.info.versions,
    }
