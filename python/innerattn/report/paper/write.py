"""The paper's Table II, Fig. 4 and Fig. 5 from finished runs, as files in a folder."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from innerattn.experiments.paper.fig4 import PRINTED_NATS, fig4_json
from innerattn.experiments.paper.fig5 import evidence_json
from innerattn.experiments.paper.findings import PARTS, Findings, find
from innerattn.experiments.paper.scene import scene_json
from innerattn.experiments.run import FinishedRun, named_from
from innerattn.report.folder import ReportFolder
from innerattn.report.paper.fig4 import fig4_csv
from innerattn.report.paper.fig5 import evidence_table
from innerattn.report.paper.page import claims_page, report_page
from innerattn.report.paper.table2 import table2_csv, table2_markdown
from innerattn.report.plots.aligned import draw_aligned
from innerattn.report.plots.drawing import check_format
from innerattn.report.plots.entropy import draw_entropy
from innerattn.report.plots.handoff import draw_handoff
from innerattn.report.table import csv_text, markdown

REPORT = ("report.md", "claims.md", "runs.csv")
"""The files of every report."""

FILES = {
    "table2": ("table2.csv", "table2.json", "table2.md"),
    "fig4": ("fig4.csv", "fig4.json", "fig4.pdf", "fig4.png"),
    "fig5": (
        *(f"fig5{part}.{kind}" for part in ("", "_evidence") for kind in ("json", "pdf", "png")),
        "fig5_evidence.md",
    ),
}
"""The files of each part."""


def write_report(
    runs: Sequence[FinishedRun],
    folder: Path,
    budget: str,
    left_out: Sequence[str] = (),
    parts: Collection[str] = PARTS,
) -> Findings:
    """Write `REPORT` and the `FILES` of the parts into ``folder``, which is made if needed.

    The same runs give the same bytes. ``report.md`` is the page; it links the rest. A figure that
    has nothing to show is not drawn, and removed where it was drawn before. Archived runs are
    enough for the table; what needs their steps is left out.

    Args:
        runs: finished runs with evaluations; they are read only.
        folder: where to write.
        budget: name of the budget they were trained with; with "quick" every file says that this is
            a smoke run.
        left_out: what is said of runs that were planned and are not among ``runs``.
        parts: which of `PARTS`.

    Returns:
        What the report says.

    Raises:
        RunError: runs are missing, unfinished, not what they are listed as, or cannot be compared;
            or matplotlib is not installed and a figure is to be drawn.
        ValueError: a part is unknown.
        OSError: the files cannot be written; each is written whole or not at all.
    """
    if {"fig4", "fig5"} & set(parts):
        check_format(folder / "fig4.png")
    findings = find(runs, parts)
    folder.mkdir(parents=True, exist_ok=True)
    _write(ReportFolder(folder, budget), findings, left_out)
    return findings


def _write(folder: ReportFolder, findings: Findings, left_out: Sequence[str]) -> None:
    """Write the report and the files of the parts that there are."""
    if findings.table is not None:
        folder.json("table2.json", findings.table.to_json())
        folder.markdown("table2.md", table2_markdown(findings.table))
        folder.csv("table2.csv", table2_csv(findings.table))
    if findings.courses is not None:
        folder.json("fig4.json", fig4_json(findings.courses))
        folder.csv("fig4.csv", fig4_csv(findings.courses))
        drawn = [course for course in findings.courses if course.chooses]
        folder.draw("fig4", draw_entropy(drawn, PRINTED_NATS) if drawn else None)
    if findings.evidence is not None:
        _write_fig5(folder, findings)
    folder.csv("runs.csv", _runs_csv(findings.runs, folder.path))
    folder.markdown("claims.md", claims_page(findings))
    folder.markdown("report.md", report_page(findings, folder.budget, left_out))


def _write_fig5(folder: ReportFolder, findings: Findings) -> None:
    found, scene = findings.evidence or (), findings.scene
    folder.json("fig5_evidence.json", evidence_json(found))
    table = f"# Attention at handoffs, every run\n\n{markdown(evidence_table(found))}"
    folder.markdown("fig5_evidence.md", table)
    folder.draw("fig5_evidence", draw_aligned(found) if found else None)
    if scene is not None:
        folder.json("fig5.json", scene_json(scene))
    else:
        (folder.path / "fig5.json").unlink(missing_ok=True)
    folder.draw("fig5", draw_handoff(scene) if scene else None)


def _runs_csv(runs: Sequence[FinishedRun], folder: Path) -> str:
    """What names each run."""
    heads = ["situation", "method", "seed", "folder", "env_steps", "config_sha256"]
    rows = [
        [
            *(run.situation, run.method, run.seed, named_from(run.folder, folder)),
            *(run.config.train.env_steps, run.config_sha256, run.weights_sha256),
        ]
        for run in runs
    ]
    return csv_text([*heads, "weights_sha256"], rows)
