"""What a study makes of its finished runs: the report, its table and its figures, as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.experiments.paper.findings import PARTS
from innerattn.experiments.run import FinishedRun
from innerattn.report.crossed.write import FILES as CROSSED_FILES
from innerattn.report.crossed.write import write_crossed
from innerattn.report.paper.write import FILES as PAPER_FILES
from innerattn.report.paper.write import REPORT, write_report

FILES = {**PAPER_FILES, "crossed": CROSSED_FILES}
"""The files of each target, besides `REPORT` of all but the crossed design."""


def make_outputs(
    target: str, runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
) -> list[Path]:
    """Make what was asked for.

    Args:
        target: one of `innerattn.experiments.plan.TARGETS`.
        runs: the finished runs; where some failed or were left out, fewer than planned.
        out: folder of the study.
        budget: name of the budget they were trained with.
        left_out: what is to be said of each run that is not among ``runs``.

    Returns:
        The files that are there now; none without runs, where those of earlier runs are removed.

    Raises:
        RunError: runs cannot be compared, or matplotlib is not installed.
        OSError: a file cannot be written or removed.
    """
    parts = PARTS if target == "all" else (target,)
    report = () if target == "crossed" else REPORT
    files = [out / name for name in (*report, *(name for part in parts for name in FILES[part]))]
    if not runs:
        for path in files:
            path.unlink(missing_ok=True)
    elif target == "crossed":
        write_crossed(runs, out, budget, left_out)
    else:
        write_report(runs, out, budget, parts, left_out)
    return [path for path in files if path.exists()]
