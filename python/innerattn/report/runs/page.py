"""The page about finished runs: tables, interactive plots and the replay in one file."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import tomli_w

from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import RunError
from innerattn.experiments.paper.fig4 import fig4
from innerattn.experiments.paper.fig5 import evidence
from innerattn.experiments.paper.table2 import table2
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, read_run
from innerattn.records.run_folder import read_config
from innerattn.report.html import fill, html_table, json_text, shared_text
from innerattn.report.paper.fig4 import entropy_table
from innerattn.report.paper.fig5 import evidence_summary, shift_sentence
from innerattn.report.paper.table2 import sharing_summary
from innerattn.report.replay.data import MOST_RECORDS, refuse_what_cannot_replay
from innerattn.report.replay.page import replay_page
from innerattn.report.runs.groups import grouped, in_situations
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
    verdict,
    versions_text,
)
from innerattn.studies.curves import learning_curves

_WEB = files("innerattn.report.runs") / "web"
_SHARING = (
    "Share: the part of a task's rescues in which the first of the two robots helped. Even: the "
    "90 % interval is within the margin (two one-sided tests); uneven: the 95 % interval is "
    "outside; else undecided."
)


def read_runs(folders: Sequence[Path]) -> list[FinishedRun]:
    """The finished runs in some folders that one page can tell of.

    Raises:
        RunError: a folder holds no finished and measured run, or two runs differ by nothing.
        ConfigError: a configuration is not valid.
    """
    found = []
    for folder in folders:
        config = read_config(folder)
        case = Case(config.scenario.situation, config.train.method, config.train.seed)
        found.append(read_run(case, folder.resolve()))
    grouped(found)
    return found


def runs_page(
    runs: Sequence[FinishedRun],
    robustness: dict[str, Any] | None = None,
    notes: Sequence[str] = (),
) -> str:
    """A page that tells what was trained, how, what it scored and how it acts.

    Every number is stored in the runs or in ``robustness``, or is a mean over the runs.

    Args:
        runs: finished runs of any scenarios and methods, at least one, with their single steps.
        robustness: the document of ``innerattn robustness --json``.
        notes: what is said above all else, such as which runs are missing.

    Returns:
        The page; it loads nothing from elsewhere.

    Raises:
        RunError: two runs differ by nothing, or hold no metrics; or ``robustness`` is no such
            document.
    """
    groups = grouped(runs)
    runs = [run for group in groups for run in group]
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
    title = ", ".join(f"{group[0].method} on {group[0].case.worlds}" for group in groups)
    count = "1 run" if len(runs) == 1 else f"{len(runs)} runs"
    return fill(
        _text("report.html"),
        title=escape(title),
        verdict=escape(verdict(groups)),
        subtitle=escape(f"{count}; {versions_text(runs)}"),
        style=shared_text("colours.css", "page.css"),
        script=f"{shared_text('dom.js', 'theme.js', 'marks.js', 'plots.js')}\n{_text('report.js')}",
        parts="\n".join(parts),
        plots=json_text([plot.to_json() for plot in plots]),
    )


def _section(title: str, *parts: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def _figure(plot: Plot, plots: list[Plot]) -> str:
    """Where the page's script draws a plot, which is added to ``plots``."""
    plots.append(plot)
    note = escape(plot.note)
    return f'<figure><div class="plot"></div><figcaption>{note}</figcaption></figure>'


def _details(summary: str, inside: str) -> str:
    return f"<details><summary>{escape(summary)}</summary>{inside}</details>"


def _training(
    runs: Sequence[FinishedRun], groups: Sequence[Sequence[FinishedRun]], plots: list[Plot]
) -> str:
    curves = learning_curves((own[0].case.worlds, own[0].method, own) for own in groups)
    parts = [html_table(training_table(runs))]
    if curves:
        for worlds in dict.fromkeys(curve.situation for curve in curves):
            alike = [curve for curve in curves if curve.situation == worlds]
            parts.append(_figure(curves_plot(alike), plots))
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
    parts = [_figure(entropy_plot(course), plots) for course in courses]
    parts.append(html_table(entropy_table(courses)))
    found = [one for one in map(evidence, groups) if one is not None]
    if found:
        for one in found:
            parts += [_figure(handoff_plot(one), plots), f"<p>{escape(shift_sentence(one))}</p>"]
        parts.append(html_table(evidence_summary(found)))
    else:
        parts.append("<p>No handoff was recorded that tells anything about attention.</p>")
    return _section("Attention", *parts)


def _sharing(groups: Sequence[Sequence[FinishedRun]]) -> str:
    parts = []
    for situation, alike in in_situations(groups).items():
        parts.append(f"<h3>{escape(situation)}</h3>")
        try:
            table = table2(alike)
        except RunError as error:
            parts.append(f"<p>Left out: {escape(str(error))}.</p>")
        else:
            parts.append(html_table(sharing_summary(table, situation)))
    title = "How two robots share the work (Table II)"
    return _section(title, f"<p>{escape(_SHARING)}</p>", *parts)


def _robustness(document: dict[str, Any], plots: list[Plot]) -> str:
    try:
        table, plot = robustness_table(document), robustness_plot(document)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise RunError("robustness: not a document of innerattn robustness --json") from error
    return _section("Robustness", _figure(plot, plots), html_table(table))


def _replay(runs: Sequence[FinishedRun]) -> str:
    """The replay of the first run, and of others that were recorded in the same worlds."""
    shown: list[FinishedRun] = []
    for run in runs:
        try:
            refuse_what_cannot_replay([one.recorded for one in (*shown, run)], _folders(shown, run))
        except RunError:
            continue
        shown.append(run)
    if not shown:
        return _section("Episodes", "<p>Left out: no run was recorded step by step.</p>")
    note = ""
    if len(shown) < len(runs):
        names = ", ".join(_folders(shown))
        note = f"<p>Shown, since a replay holds up to {MOST_RECORDS} runs of the same worlds: "
        note += f"{escape(names)}.</p>"
    page = replay_page([run.recorded for run in shown], _folders(shown))
    frame = f'<iframe title="Replay" srcdoc="{escape(page, quote=True)}"></iframe>'
    return _section("Episodes", note, frame)


def _folders(runs: Sequence[FinishedRun], *more: FinishedRun) -> list[str]:
    return [run.folder.name for run in (*runs, *more)]


def read_robustness(path: Path) -> dict[str, Any]:
    """The document in a file that ``innerattn robustness --json`` wrote.

    Raises:
        RunError: it cannot be read, or is none.
    """
    try:
        found = parse_json(read_plain(path, MOST_JSON_BYTES, follow_link=True))
        if found["schema_version"] != 1 or not found["policies"]:
            raise ValueError("another document")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path}: not a document of innerattn robustness --json") from error
    return dict(found)


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
