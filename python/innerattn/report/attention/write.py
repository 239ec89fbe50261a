"""What learnt attention is worth, from finished runs, as files in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from innerattn.experiments.attention.study import MARGIN, AttentionStudy, read_attention
from innerattn.experiments.run import FinishedRun
from innerattn.report.attention.page import attention_page, score_panels
from innerattn.report.folder import ReportFolder, listed_runs
from innerattn.report.plots.arms import draw_arms
from innerattn.report.plots.drawing import check_format
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 1

FILES = tuple(f"attention.{kind}" for kind in ("json", "md", "pdf", "png"))
"""What `write_attention` writes."""


def write_attention(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str] = ()
) -> AttentionStudy:
    """Write `FILES` into ``out``; the same runs give the same bytes.

    Args:
        runs: finished runs, at least one; they are read only.
        out: folder of the study; the runs' folders are named from there.
        budget: name of the budget they were trained with.
        left_out: what is said of runs that were planned and are not among ``runs``.

    Returns:
        What the report says.

    Raises:
        RunError: runs cannot be compared, or matplotlib is not installed.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    check_format(out / "attention.png")
    found = read_attention(runs)
    folder = ReportFolder(out, budget)
    document = {
        "schema_version": SCHEMA_VERSION,
        "budget": budget,
        "margin": MARGIN,
        "learnt": as_json(found.learnt),
        "comparisons": as_json(found.comparisons),
        "long_comparisons": as_json(found.long_comparisons),
        "runs": listed_runs(runs, out),
    }
    folder.json("attention.json", document)
    folder.draw("attention", draw_arms(score_panels(found)))
    folder.markdown("attention.md", attention_page(found, budget, "attention.png", left_out))
    return found
