"""The page about finished runs: tables, interactive plots and the replay in one file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import tomli_w

from innerattn.errors import RunError
from innerattn.experiments.learning.curves import learning_curves
from innerattn.experiments.paper.fig4 import fig4
from innerattn.experiments.paper.fig5 import evidence
from innerattn.experiments.paper.table2 import table2
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, by_method, read_run, refuse_unlike
from innerattn.records.run_folder import read_config
from innerattn.report.html import fill, html_table, json_text, shared_text
from innerattn.report.paper.fig4 import entropy_table
from innerattn.report.paper.fig5 import evidence_summary
from innerattn.report.paper.table2 import sharing_summary
from innerattn.report.plotly import plot_script, plotly_script
from innerattn.report.replay.data import MOST_RECORDS, refuse_what_cannot_replay
from innerattn.report.replay.page import replay_page
from innerattn.report.runs.plots import (
    Plot,
    curves_plot,
    entropy_plot,
    handoff_plot,
    robustness_plot,
)
from innerattn.report.runs.tables import (
    curve_table,
    robustness_table,
    scores_table,
    training_table,
    versions_text,
)

_WEB = files("innerattn.report.runs") / "web"
_SHARING = (
    "Share: the part of a task's rescues in which the first of the two robots helped. Even: the "
    "90 % interval is within the margin (two one-sided tests); uneven: the 95 % interval is "
    "outside; else undecided."
)


def read_runs(folders: Sequence[Path]) -> list[FinishedRun]:
    """The finished runs in some folders that one page can tell of.

    Raises:
        RunError: a folder holds no finished and measured run, or they cannot be compared.
        ConfigError: a configuration is not valid.
        MissingLibraryError: plotly is not installed.
    """
    found = []
    for folder in folders:
        config = read_config(folder)
        case = Case(config.scenario.situation, config.train.method, config.train.seed)
        found.append(read_run(case, folder.resolve()))
    by_method(found)
    refuse_unlike(found)
    plotly_script()
    return found


def runs_page(
    runs: Sequence[FinishedRun],
    robustness: dict[str, Any] | None = None,
    notes: Sequence[str] = (),
) -> str:
    """A page that tells what was trained, how, what it scored and how it acts.

    Every number is stored in the runs or in ``robustness``, or is a mean over the runs.

    Args:
        runs: finished runs that can be compared, at least one, with their single steps.
        robustness: the document of ``innerattn robustness --json``.
        notes: what is said above all else, such as which runs are missing.

    Returns:
        The page; it loads nothing from elsewhere.

    Raises:
        RunError: runs cannot be compared, or hold no metrics; or ``robustness`` is no such
            document.
        MissingLibraryError: plotly is not installed.
    """
    groups = list(by_method(runs).values())
    refuse_unlike(runs)
    plots: list[Plot] = []
    parts = [
        *(f"<p>{escape(note)}</p>" for note in notes),
        _section("Result", html_table(scores_table(groups))),
        _training(runs, groups, plots),
        _attention(runs, groups, plots),
        _sharing(groups),
    ]
    if robustness is not None:
        parts.append(_robustness(robustness, plots))
    parts.append(_replay(runs))
    title = ", ".join(dict.fromkeys(f"{run.method} on {run.situation}" for run in runs))
    count = "1 run" if len(runs) == 1 else f"{len(runs)} runs"
    return fill(
        _text("report.html"),
        title=escape(title),
        subtitle=escape(f"{count}; {versions_text(runs)}"),
        style=shared_text("page.css"),
        library=plotly_script(),
        script=f"{plot_script()}\n{_text('report.js')}",
        parts="\n".join(parts),
        plots=json_text([plot.to_json() for plot in plots]),
    )


def _section(title: str, *parts: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def _figure(plot: Plot, plots: list[Plot]) -> str:
    """Where the page's script draws a plot, which is added to ``plots``."""
    plots.append(plot)
    label = escape(f"{plot.title}. {plot.note}", quote=True)
    return (
        f'<figure><div class="plot" role="img" aria-label="{label}"></div>'
        f"<figcaption>{escape(plot.note)}</figcaption></figure>"
    )


def _details(summary: str, inside: str) -> str:
    return f"<details><summary>{escape(summary)}</summary>{inside}</details>"


def _training(
    runs: Sequence[FinishedRun], groups: Sequence[Sequence[FinishedRun]], plots: list[Plot]
) -> str:
    curves = learning_curves(groups)
    parts = [html_table(training_table(runs))]
    if curves:
        parts.append(_figure(curves_plot(curves), plots))
        parts.append(_details("Numbers of the curve", html_table(curve_table(curves))))
    for group in groups:
        run = group[0]
        text = tomli_w.dumps(run.config.model_dump(exclude_none=True))
        name = f"Configuration of {run.folder.name}"
        parts.append(_details(name, f'<pre tabindex="0">{escape(text)}</pre>'))
    return _section("Training", *parts)


def _attention(
    runs: Sequence[FinishedRun], groups: Sequence[Sequence[FinishedRun]], plots: list[Plot]
) -> str:
    courses = [course for course in fig4(runs) if course.chooses]
    if not courses:
        return _section("Attention", "<p>These runs have no learnt attention.</p>")
    parts = [_figure(entropy_plot(courses), plots), html_table(entropy_table(courses))]
    found = [one for one in map(evidence, groups) if one is not None]
    if found:
        parts += [_figure(handoff_plot(found), plots), html_table(evidence_summary(found))]
    else:
        parts.append("<p>No handoff was recorded that tells anything about attention.</p>")
    return _section("Attention", *parts)


def _sharing(groups: Sequence[Sequence[FinishedRun]]) -> str:
    title = "How two robots share the work (Table II)"
    try:
        table = table2(groups)
    except RunError as error:
        return _section(title, f"<p>Left out: {escape(str(error))}.</p>")
    situations = dict.fromkeys(row.situation for row in table.rows)
    parts = [html_table(sharing_summary(table, situation)) for situation in situations]
    return _section(title, f"<p>{escape(_SHARING)}</p>", *parts)


def _robustness(document: dict[str, Any], plots: list[Plot]) -> str:
    try:
        table, plot = robustness_table(document), robustness_plot(document)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise RunError("robustness: not a document of innerattn robustness --json") from error
    return _section("Robustness", _figure(plot, plots), html_table(table))


def _replay(runs: Sequence[FinishedRun]) -> str:
    """The replay of runs that were recorded in the same worlds, or of the first."""
    shown = list(runs[:MOST_RECORDS])
    names = [run.folder.name for run in shown]
    note = ""
    try:
        refuse_what_cannot_replay([run.recorded for run in shown], names)
    except RunError:
        shown, names = shown[:1], names[:1]
        note = "<p>Runs were recorded in different worlds, so only the first is shown.</p>"
    try:
        page = replay_page([run.recorded for run in shown], names)
    except RunError as error:
        return _section("Episodes", f"<p>Left out: {escape(str(error))}.</p>")
    frame = f'<iframe title="Replay" srcdoc="{escape(page, quote=True)}"></iframe>'
    return _section("Episodes", note, frame)


def read_robustness(path: Path) -> dict[str, Any]:
    """The document in a file that ``innerattn robustness --json`` wrote.

    Raises:
        RunError: it cannot be read, or is none.
    """
    try:
        found = json.loads(path.read_text("utf-8"))
        if found["schema_version"] != 1 or not found["policies"]:
            raise ValueError("another document")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise RunError(f"{path}: not a document of innerattn robustness --json") from error
    return dict(found)


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
