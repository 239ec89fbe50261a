"""The paper's Table II, Fig. 4 and Fig. 5 from finished runs, as files in a folder."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from innerattn.config.files import write_whole
from innerattn.experiments.paper.fig4 import PRINTED_NATS, fig4, fig4_json
from innerattn.experiments.paper.fig5 import evidence, evidence_json
from innerattn.experiments.paper.scene import HandoffScene, choose_scene, scene_json
from innerattn.experiments.paper.table2 import PRINTED_SITUATION, table2
from innerattn.experiments.run import (
    FinishedRun,
    by_method,
    refuse_unlike,
    refuse_without_steps,
)
from innerattn.experiments.smoke import smoke_note
from innerattn.report.paper.fig4 import fig4_csv, fig4_lines
from innerattn.report.paper.fig5 import evidence_lines
from innerattn.report.paper.page import Findings, report_markdown
from innerattn.report.paper.table2 import table2_csv, table2_markdown
from innerattn.report.plots.aligned import draw_aligned
from innerattn.report.plots.drawing import check_format, write_figure
from innerattn.report.plots.entropy import draw_entropy
from innerattn.report.plots.handoff import draw_handoff
from innerattn.report.smoke import mark_figure, noted_csv, noted_markdown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = ("table2", "fig4", "fig5")
"""What can be asked for."""


def write_report(
    runs: Sequence[FinishedRun],
    folder: Path,
    budget: str,
    parts: Collection[str] = PARTS,
    left_out: Sequence[str] = (),
) -> Findings:
    """Write ``report.md`` and the files of the parts into ``folder``, which is made if needed.

    The same runs give the same bytes. The files are table2.json, .md and .csv; fig4.json, .csv,
    .pdf and .png; fig5.json, .pdf and .png, which show one handoff; and fig5_evidence.json, .pdf
    and .png. A figure that has nothing to show is not drawn, and removed where it was drawn before.
    Archived runs are enough for the table; what needs their steps is left out.

    Args:
        runs: finished runs with evaluations; they are read only.
        folder: where to write.
        budget: name of the budget they were trained with; with "quick" every file says that this is
            a smoke run.
        parts: which of `PARTS`.
        left_out: what is said of runs that were planned and are not among ``runs``.

    Returns:
        What the report says.

    Raises:
        RunError: runs are missing, unfinished, not what they are listed as, or cannot be compared;
            or matplotlib is not installed and a figure is to be drawn.
        ValueError: a part is unknown.
        OSError: the files cannot be written; each is written whole or not at all.
    """
    if unknown := sorted(set(parts) - set(PARTS)):
        raise ValueError(f"parts = {unknown}: known are {', '.join(PARTS)}")
    if {"fig4", "fig5"} & set(parts):
        check_format(folder / "fig4.png")
    groups = list(by_method(runs).values())
    ordered = tuple(run for group in groups for run in group)
    refuse_unlike(ordered)
    if "fig5" in parts:
        refuse_without_steps(ordered)
    findings = Findings(
        budget=budget,
        folder=folder,
        runs=ordered,
        table=table2(groups) if "table2" in parts else None,
        courses=tuple(fig4(ordered)) if "fig4" in parts else None,
        scene=_scene(groups) if "fig5" in parts else None,
        evidence=tuple(filter(None, map(evidence, groups))) if "fig5" in parts else None,
        left_out=tuple(left_out),
    )
    folder.mkdir(parents=True, exist_ok=True)
    _write_parts(findings, folder)
    text = noted_markdown(report_markdown(findings), budget)
    write_whole(folder / "report.md", text.encode())
    return findings


def _scene(groups: Sequence[Sequence[FinishedRun]]) -> HandoffScene | None:
    """A handoff of TD with inner attention in the mixed situation, or of what comes nearest."""

    def distance(group: Sequence[FinishedRun]) -> tuple[bool, bool]:
        run = group[0]
        return run.situation != PRINTED_SITUATION, run.method != "td-inner"

    scenes = (choose_scene(group) for group in sorted(groups, key=distance))
    return next((scene for scene in scenes if scene is not None), None)


def _write_parts(findings: Findings, folder: Path) -> None:
    budget = findings.budget
    if findings.table is not None:
        _write_json(folder / "table2.json", findings.table.to_json(), budget)
        text = noted_markdown(table2_markdown(findings.table), budget)
        write_whole(folder / "table2.md", text.encode())
        lines = noted_csv(table2_csv(findings.table), budget)
        write_whole(folder / "table2.csv", lines.encode())
    if findings.courses is not None:
        _write_json(folder / "fig4.json", fig4_json(findings.courses), budget)
        write_whole(folder / "fig4.csv", noted_csv(fig4_csv(findings.courses), budget).encode())
        courses = fig4_lines(findings.courses)
        _draw(folder / "fig4", draw_entropy(courses, PRINTED_NATS) if courses else None, budget)
    if findings.evidence is not None:
        _write_json(folder / "fig5_evidence.json", evidence_json(findings.evidence), budget)
        drawn = draw_aligned(evidence_lines(findings.evidence)) if findings.evidence else None
        _draw(folder / "fig5_evidence", drawn, budget)
        if findings.scene is not None:
            _write_json(folder / "fig5.json", scene_json(findings.scene), budget)
        else:
            (folder / "fig5.json").unlink(missing_ok=True)
        _draw(folder / "fig5", draw_handoff(findings.scene) if findings.scene else None, budget)


def _write_json(path: Path, document: dict[str, Any], budget: str) -> None:
    noted = {"note": smoke_note(budget), **document}
    write_whole(path, f"{json.dumps(noted, allow_nan=False)}\n".encode())


def _draw(path: Path, figure: Figure | None, budget: str) -> None:
    """Write a figure, or remove that of other runs where there is none."""
    if figure is not None:
        mark_figure(figure, budget)
    for suffix in (".pdf", ".png"):
        drawn = path.with_suffix(suffix)
        if figure is None:
            drawn.unlink(missing_ok=True)
        else:
            write_figure(drawn, figure)
