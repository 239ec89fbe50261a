"""What faults cost, from finished runs and the documents of their study, as files in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.experiments.robustness.results import Robustness, read_robustness
from innerattn.experiments.run import FinishedRun
from innerattn.report.folder import ReportFolder, listed_runs
from innerattn.report.robustness.page import robustness_page
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 1

FILES = ("robustness.json", "robustness.md")
"""What `write_robustness` writes."""


def write_robustness(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
) -> Robustness:
    """Write `FILES` into ``out``; the same runs and documents give the same bytes.

    Args:
        runs: finished runs of the study, at least one; they are read only.
        out: folder of the study, which holds the documents.
        budget: name of the budget the runs were trained with.
        left_out: what is said of runs and measurements that are missing.

    Returns:
        What the report says.

    Raises:
        RunError: a document is damaged.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    found = read_robustness(runs, out)
    folder = ReportFolder(out, budget)
    document = {"schema_version": SCHEMA_VERSION, "budget": budget, **as_json(found)}
    folder.json("robustness.json", {**document, "runs": listed_runs(runs, out)})
    folder.markdown("robustness.md", robustness_page(found, budget, left_out))
    return found
