"""A study as files in its folder: page, document, figures, and scores for other tools."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from innerattn.experiments.smoke import smoke_note
from innerattn.report.folder import ReportFolder
from innerattn.report.plots.arms import ArmDots, ArmPanel, draw_arms
from innerattn.report.plots.curves import CurveLine, draw_curves
from innerattn.report.study.exports import marl_eval_document, rliable_document
from innerattn.report.study.page import (
    Found,
    algorithm_names,
    study_document,
    study_page,
    varied_in,
)
from innerattn.studies.aggregates import aggregate
from innerattn.studies.curves import LearningCurve, learning_curves
from innerattn.studies.folder import StudyFolder
from innerattn.studies.results import Mean, Result, Results, chosen, compare, means
from innerattn.studies.study import SCORES, Length, Value

_LENGTHS: tuple[Length, ...] = ("standard", "long")
_MOST_ROWS = 40
"""Rows of a figure of scores at most; a larger study has its tables."""


def write_study(study: StudyFolder, results: Results) -> tuple[Found, list[Path]]:
    """Write the report of a study into its folder; the same runs give the same bytes.

    Figures need matplotlib; without it, and of archived runs, there are no learning curves.

    Args:
        study: in its folder.
        results: its finished runs.

    Returns:
        What the report says, and its files.

    Raises:
        RunError: metrics of a run cannot be read.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    found = find(study, results)
    budgets = {str(run.place["budget"]) for run in study.planned}
    folder = ReportFolder(study.path, "quick" if found.note else min(budgets))
    files = ["report.md", "report.json", "scores.json", "marl_eval.json"]
    figures = _draw(folder, found) if find_spec("matplotlib") else {}
    folder.json("report.json", study_document(found))
    folder.json("scores.json", rliable_document(found.aggregates["standard"]))
    exported = [one for one in results.finished if one.finished and not one.finished.archived]
    document = marl_eval_document(found.aggregates["standard"], exported, study.runs)
    folder.json("marl_eval.json", document, note=False)
    folder.markdown("report.md", study_page(found, figures), note=False)
    return found, [study.path / name for name in (*files, *figures.values())]


def find(study: StudyFolder, results: Results) -> Found:
    """What the report of a study says.

    Raises:
        RunError: metrics of a run cannot be read.
    """
    finished = results.finished
    budgets = {str(run.place["budget"]) for run in study.planned}
    notes = [note for budget in sorted(budgets) if (note := smoke_note(budget))]
    tables = study.study.tables or (SCORES,)
    return Found(
        study=study,
        states=study.states(),
        results=results,
        tables={table.title: (table, means(finished, table)) for table in tables},
        compared=compare(study.study, study.planned, finished),
        aggregates={length: algorithm_names(aggregate(finished, length)) for length in _LENGTHS},
        curves={one.title: _curves(chosen(finished, one.of)) for one in study.study.curves},
        note=notes[0] if notes else None,
    )


def _curves(results: Sequence[Result]) -> list[LearningCurve]:
    """Curves by scenario and algorithm; none of a group with an archived run."""
    names = _names([one.run.place for one in results])
    groups: dict[tuple[str, str], list[Result]] = {}
    for one, name in zip(results, names, strict=True):
        groups.setdefault((str(one.run.place["scenario"]), name), []).append(one)
    whole = (
        (*key, [one.finished for one in own if one.finished is not None])
        for key, own in groups.items()
        if all(one.finished is not None and not one.finished.archived for one in own)
    )
    return learning_curves(whole)


def _names(places: Sequence[Mapping[str, Value]]) -> list[str]:
    """What tells places of one scenario apart."""
    varied = [key for key in varied_in(places) if key != "scenario"] or ["method"]
    return [" ".join(filter(None, (str(place.get(key, "")) for key in varied))) for place in places]


def _draw(folder: ReportFolder, found: Found) -> dict[str, str]:
    """Draw what there is; files by what they show."""
    figures = {}
    rows = means(found.results.finished)
    panels = score_panels(rows) if len(rows) <= _MOST_ROWS else []
    folder.draw("scores", draw_arms(panels) if panels else None)
    if panels:
        figures["scores"] = "scores.png"
    for title, curves in found.curves.items():
        name = f"curves-{re.sub('[^a-z0-9]+', '-', title.lower()).strip('-')}"
        lines = [
            CurveLine(
                one.situation,
                one.method,
                one.env_steps,
                one.seconds,
                np.stack([one.rescues.mean, one.rescues.low, one.rescues.high]),
                one.scripts,
            )
            for one in curves
        ]
        folder.draw(name, draw_curves(lines, "rescues per episode of training") if lines else None)
        if lines:
            figures[title] = f"{name}.png"
    return figures


def score_panels(found: Sequence[Mean]) -> list[list[ArmPanel]]:
    """A row for each scenario, a panel for each length of episodes; none without a score."""
    names = _names([one.place for one in found])
    rows = []
    for scenario in dict.fromkeys(str(one.place["scenario"]) for one in found):
        here = [
            (one, name)
            for one, name in zip(found, names, strict=True)
            if one.place["scenario"] == scenario
        ]
        row = []
        for length in _LENGTHS:
            dots = []
            for one, name in here:
                values = one.values["score", length]
                known = tuple(x for x in values.each.values() if x is not None)
                mean = values.mean
                bar = None
                if mean is not None and mean.low is not None and mean.high is not None:
                    bar = (mean.mean, mean.low, mean.high)
                learnt = str(one.place["method"]).endswith("-inner")
                dots.append(ArmDots(name, learnt, known, bar))
            steps = here[0][0].episode_steps[length]
            row.append(ArmPanel(scenario, f"score, {steps} steps", tuple(dots), marks=(1.0,)))
        rows.append(row)
    scored = any(dot.values for row in rows for panel in row for dot in panel.arms)
    return rows if scored else []
