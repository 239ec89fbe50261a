"""What a study makes of its finished runs: the report, its table and its figures, as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.study.crossed.report import write_crossed
from innerattn.study.inventory import FinishedRun
from innerattn.study.report import PARTS, write_report
from innerattn.study.run import StudyRun


def make_outputs(
    target: str, runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str]
) -> list[Path]:
    """Make what was asked for.

    Args:
        target: one of `innerattn.study.plan.TARGETS`.
        runs: the finished runs; where some failed or were left out, fewer than planned.
        out: folder of the study.
        budget: name of the budget they were trained with.
        left_out: what is to be said of each run that is not among ``runs``.

    Returns:
        The files that are there now; none without runs.

    Raises:
        RunError: runs cannot be compared, or matplotlib is not installed.
        OSError: a file cannot be written.
    """
    if not runs:
        return []
    if target == "crossed":
        write_crossed(runs, out, budget, left_out)
        return [out / f"crossed.{kind}" for kind in ("csv", "json", "md", "pdf", "png")]
    parts = PARTS if target == "all" else (target,)
    listed = [StudyRun(*_label(run), run.folder) for run in runs]
    write_report(listed, out, budget, parts, left_out)
    made = (path for part in parts for path in sorted(out.glob(f"{part}*.*")))
    return [out / "report.md", *made]


def _label(run: FinishedRun) -> tuple[str, str, int]:
    return run.case.situation, run.case.method, run.case.seed
