"""A study as files in its folder: page, document, figures, and scores for other tools."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from innerattn.experiments.smoke import smoke_note
from innerattn.report.folder import ReportFolder
from innerattn.report.plots.arms import ArmDots, ArmPanel, draw_arms
from innerattn.report.plots.curves import draw_curves
from innerattn.report.plots.leads import draw_leads
from innerattn.report.plots.search import TrialDot, draw_search
from innerattn.report.study.document import study_document
from innerattn.report.study.exports import marl_eval_document, rliable_document
from innerattn.report.study.page import (
    Found,
    algorithm_names,
    study_page,
)
from innerattn.report.study.places import varied_in
from innerattn.report.study.search import SearchFound, search_found
from innerattn.studies.actor_attention import LeadCurves, lead_curves
from innerattn.studies.aggregates import aggregate
from innerattn.studies.curves import LearningCurve, learning_curves
from innerattn.studies.folder import StudyFolder
from innerattn.studies.plan import PlannedRun
from innerattn.studies.results import Mean, Result, Results, chosen, compare, means
from innerattn.studies.search.optuna import write_journal
from innerattn.studies.search.state import Now, Watched
from innerattn.studies.shown import HANDOFFS
from innerattn.studies.space import Length, Value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LENGTHS: tuple[Length, ...] = ("standard", "long")
_MOST_ROWS = 40
"""Rows of a figure of scores at most; a larger study has its tables."""


def write_study(
    study: StudyFolder, results: Results, now: Now | None = None
) -> tuple[Found, list[Path]]:
    """Write the report of a study into its folder; the same runs give the same bytes.

    Only the journal of Optuna holds times, and differs.

    Figures need matplotlib; without it, and of archived runs, there are no learning curves.

    Args:
        study: in its folder.
        results: its finished runs.
        now: how far it is; None: looked up, if it has a search.

    Returns:
        What the report says, and its files.

    Raises:
        RunError: metrics of a run, or what was measured of it, cannot be read.
        OSError: a file cannot be written; each is written whole or not at all.
    """
    found = find(study, results, now)
    budgets = {str(run.place["budget"]) for run in study.planned}
    folder = ReportFolder(study.path, "quick" if found.note else min(budgets))
    figures = _draw(folder, found) if find_spec("matplotlib") else {}
    folder.json("report.json", study_document(found))
    folder.markdown("report.md", study_page(found, figures), note=False)
    if found.search is None:
        others = _write_scores(folder, found)
    else:
        others = _write_journal(found.search) if find_spec("optuna") else []
    names = ["report.md", "report.json", *others, *figures.values()]
    return found, [study.path / name for name in names]


def _write_scores(folder: ReportFolder, found: Found) -> list[str]:
    """Write scores for other tools."""
    folder.json("scores.json", rliable_document(found.aggregates["standard"]))
    document = marl_eval_document(found.aggregates["standard"], found.results.finished)
    folder.json("marl_eval.json", document, note=False)
    return ["scores.json", "marl_eval.json"]


def _write_journal(found: SearchFound) -> list[str]:
    """Write the trials for Optuna's tools."""
    path = found.study.path / "optuna.log"
    write_journal(found.search, found.state.standings, path, found.study.path.resolve().name)
    return [path.name]


def find(study: StudyFolder, results: Results, now: Now | None = None) -> Found:
    """What the report of a study says; arguments as of `write_study`.

    Raises:
        RunError: metrics of a run cannot be read.
    """
    finished = results.finished
    budgets = {str(run.place["budget"]) for run in study.planned}
    notes = [note for budget in sorted(budgets) if (note := smoke_note(budget))]
    found = Found(study, study.states(), results, note=notes[0] if notes else None)
    if study.study.search is not None:
        search = search_found(now or Watched(study).now(), finished)
        return replace(found, search=search, compared=search.confirmed)
    return replace(
        found,
        tables={one.title: (one, means(finished, one)) for one in study.study.listed_tables},
        compared=compare(study.study, study.planned, finished),
        aggregates={length: algorithm_names(aggregate(finished, length)) for length in _LENGTHS},
        curves={one.title: _curves(chosen(finished, one.of)) for one in study.study.curves},
        leads=_leads(study, finished) if study.study.actor_attention else {},
    )


def _leads(study: StudyFolder, results: Sequence[Result]) -> dict[str, LeadCurves]:
    """Attention around handoffs by place in the grid, named by what differs between places."""
    places = [one.run.place for one in results]
    varied = varied_in(places) or ["scenario"]
    groups: dict[str, list[PlannedRun]] = {}
    for one in results:
        name = " ".join(str(one.run.place[key]) for key in varied if key in one.run.place)
        groups.setdefault(name, []).append(one.run)
    found = {name: lead_curves(study, runs) for name, runs in groups.items()}
    return {name: one for name, one in found.items() if one is not None}


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
    if found.search is not None:
        figure = _search_figure(found.search)
        folder.draw("search", figure)
        return {} if figure is None else {"search": "search.png"}
    figures = {}
    rows = means(found.results.finished)
    panels = score_panels(rows) if len(rows) <= _MOST_ROWS else []
    folder.draw("scores", draw_arms(panels) if panels else None)
    if panels:
        figures["scores"] = "scores.png"
    if found.leads:
        folder.draw("handoffs", draw_leads(found.leads))
        figures[HANDOFFS] = "handoffs.png"
    for title, curves in found.curves.items():
        name = f"curves-{re.sub('[^a-z0-9]+', '-', title.lower()).strip('-')}"
        folder.draw(name, draw_curves(curves) if curves else None)
        if curves:
            figures[title] = f"{name}.png"
    return figures


def _search_figure(found: SearchFound) -> Figure | None:
    """Scores against cost; None before the first trial has one."""
    dots = [
        TrialDot(core_s, one.mean.mean, one.state == "finished")
        for one, core_s in zip(found.state.standings, found.spent_core_s, strict=True)
        if one.mean is not None
    ]
    recipe = found.state.standings[0].mean
    label = found.search.measure.replace("_", " ")
    most = found.search.direction == "maximize"
    return draw_search(dots, recipe.mean if recipe else None, label, most) if dots else None


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
                learnt = str(one.place["method"]).endswith("-inner")
                dots.append(ArmDots(name, learnt, known, values.mean))
            steps = here[0][0].episode_steps[length]
            row.append(ArmPanel(scenario, f"score, {steps} steps", tuple(dots), marks=(1.0,)))
        rows.append(row)
    scored = any(dot.values for row in rows for panel in row for dot in panel.arms)
    return rows if scored else []
