"""What methods learn, from finished runs, as files in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from innerattn.experiments.learning.curves import LearningCurve
from innerattn.experiments.learning.study import Learning, read_learning
from innerattn.experiments.run import FinishedRun
from innerattn.report.folder import ReportFolder, listed_runs
from innerattn.report.learning.page import curve_lines, learning_page
from innerattn.report.plots.curves import draw_curves
from innerattn.report.plots.drawing import check_format
from innerattn.stats.estimate import as_json

SCHEMA_VERSION = 1


def learning_files(name: str) -> tuple[str, ...]:
    """What `write_learning` writes."""
    return tuple(f"{name}.{kind}" for kind in ("json", "md", "pdf", "png"))


def write_learning(
    runs: Sequence[FinishedRun], out: Path, budget: str, left_out: Sequence[str], *, name: str
) -> Learning:
    """Write `learning_files` into ``out``; the same runs give the same bytes.

    Where a run is archived, or too short for an episode, there is no figure.

    Args:
        runs: finished runs of one variant, at least one; they are read only.
        out: folder of the study; the runs' folders are named from there.
        budget: name of the budget they were trained with.
        left_out: what is said of runs that were planned and are not among ``runs``.
        name: of the files.

    Returns:
        What the report says.

    Raises:
        RunError: runs cannot be compared, metrics cannot be read, or matplotlib is not installed.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    check_format(out / f"{name}.png")
    found = read_learning(runs)
    folder = ReportFolder(out, budget)
    folder.json(f"{name}.json", _document(found, runs, out, budget))
    lines = curve_lines(found)
    label = "rescues per episode of training"
    folder.draw(name, draw_curves(lines, label) if lines else None)
    figure = f"{name}.png" if lines else None
    folder.markdown(f"{name}.md", learning_page(found, budget, figure, left_out))
    return found


def _document(
    found: Learning, runs: Sequence[FinishedRun], out: Path, budget: str
) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "budget": budget,
        "learnt": as_json(found.learnt),
        "margin": found.margin,
        "differences": as_json(found.differences),
        "curves": [_curve(curve) for curve in found.curves],
        "runs": listed_runs(runs, out),
    }


def _curve(curve: LearningCurve) -> dict[str, Any]:
    return {
        "situation": curve.situation,
        "method": curve.method,
        "env_steps": curve.env_steps.tolist(),
        "seconds": curve.seconds.tolist(),
        "rescues_per_episode": curve.rescues.to_json(),
        "scripts": curve.scripts,
    }
