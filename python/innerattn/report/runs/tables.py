"""The tables of the page about runs: what was trained, and what it scored."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from innerattn.experiments.run import FinishedRun
from innerattn.experiments.score_means import MeanScores, scores_over_runs
from innerattn.measures.summary import script_score
from innerattn.policies import best_script
from innerattn.report.runs.groups import in_situations
from innerattn.report.table import Row, Table, columns, plain_table, section
from innerattn.stats import Estimate
from innerattn.stats.text import NONE, format_estimate, format_number
from innerattn.studies.curves import LearningCurve

_MOST_NAMED = 4  # groups of runs in one line
_DIGITS = 12  # of a digest, enough to tell two apart


def training_table(runs: Sequence[FinishedRun]) -> Table:
    """What each run is and how it was made."""
    heads = columns(
        ["run", "method", "situation"],
        ["seed", "env-steps", "updates", "minutes", "threads"],
    )
    more = columns(["device", "started from", "commit", "configuration", "weights"])
    rows = []
    for run in runs:
        info = run.info
        rows.append(
            [
                *(run.folder.name, run.method, run.case.worlds, str(run.seed)),
                *(f"{info.env_steps:,}", f"{info.updates:,}", f"{info.seconds / 60:.1f}"),
                *(str(info.threads), info.device, info.warm_start),
                *((text or NONE)[:_DIGITS] for text in (info.commit, run.config_sha256)),
                (run.weights_sha256 or NONE)[:_DIGITS],
            ]
        )
    note = f"Commit, configuration and weights: the first {_DIGITS} digits of their SHA digests."
    return plain_table((*heads, *more), rows, notes=(note,))


def versions_text(runs: Sequence[FinishedRun]) -> str:
    """The versions that the runs were made with."""
    found = dict.fromkeys(
        ", ".join(f"{name} {version}" for name, version in run.info.versions.items())
        for run in runs
    )
    return "; or ".join(found)


def verdict(groups: Sequence[Sequence[FinishedRun]]) -> str:
    """What the groups scored, the best first, in one line."""
    found = []
    for group in groups:
        mean = scores_over_runs(group)[0] if len(group) > 1 else None
        own = group[0].summary["score"]
        score = mean.score if mean else _estimate(own)
        of = f"mean of {len(group)} runs " if mean else ""
        name = f"{group[0].method} on {group[0].case.worlds}"
        found.append((-math.inf if score is None else score.mean, f"{name} {of}{_score(score)}"))
    found.sort(key=lambda one: one[0], reverse=True)
    shown = [text for _, text in found[:_MOST_NAMED]]
    left = f"; and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
    best = " or ".join(dict.fromkeys(best_script(group[0].summary["scripted"]) for group in groups))
    return f"Score (0 plays like random, 1 like {best}): {'; '.join(shown)}{left}"


def _score(score: Estimate | None) -> str:
    return (
        format_estimate(score)
        if score
        else "has none, since no script is surely better than random"
    )


def scores_table(groups: Sequence[Sequence[FinishedRun]]) -> Table:
    """Rescues and scores of every run, of the means over runs, and of the scripts."""
    heads = columns(["policy"], ["rescues", "score", "rescues, longer", "score, longer"])
    parts = []
    for situation, alike in in_situations(groups).items():
        for group in alike:
            rows = [Row((_name(run), *_cells(run.summary))) for run in group]
            if len(group) > 1:
                means = scores_over_runs(group)
                cells = [cell for mean in means for cell in _mean_cells(mean)]
                rows.append(Row((f"mean of {len(group)} runs", *cells), strong=True))
            first = group[0]
            lengths = " and ".join(str(part["episode_steps"]) for part in _lengths(first))
            title = f"{first.method}, situation {situation}, episodes of {lengths} steps"
            parts.append(section(rows, title))
        name = alike[0][0].folder.name
        parts.append(section(_script_rows(alike[0][0]), f"scripts, in the worlds of {name}"))
    notes = (
        "Rescues per episode, at two lengths of episodes. Score: 0 is random, 1 the best script.",
        "Brackets: 95 % intervals, over episodes for a run, over runs (Student's t) for a mean.",
    )
    return Table(heads, tuple(parts), notes=notes)


def _lengths(run: FinishedRun) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """What the summary holds at both lengths of episodes."""
    return run.summary, run.summary["long"]


def _name(run: FinishedRun) -> str:
    return f"{run.folder.name} (seed {run.seed})"


def _cells(summary: Mapping[str, Any]) -> list[str]:
    """Rescues and score at both lengths, as the summary holds them."""
    return [
        format_estimate(_estimate(part[name]))
        for part in (summary, summary["long"])
        for name in ("rescues_per_episode", "score")
    ]


def _estimate(document: Mapping[str, Any] | None) -> Estimate | None:
    return None if document is None else Estimate.from_json(document)


def _mean_cells(mean: MeanScores) -> list[str]:
    return [format_estimate(mean.rescues_per_episode), format_estimate(mean.score)]


def _script_rows(run: FinishedRun) -> list[list[str]]:
    return [
        [name, *(cell for part in _lengths(run) for cell in _script_cells(part, name))]
        for name in run.summary["scripted"]
    ]


def _script_cells(part: Mapping[str, Any], name: str) -> tuple[str, str]:
    """Rescues and score of a script."""
    scripted = {one: Estimate.from_json(found) for one, found in part["scripted"].items()}
    score = script_score(scripted, name) if part["score"] else None
    return format_estimate(scripted[name]), NONE if score is None else format_number(score)


def curve_table(curves: Sequence[LearningCurve]) -> Table:
    """The numbers of the training curves."""
    unit = " or ".join(dict.fromkeys(curve.unit for curve in curves))
    heads = columns(["method", "situation"], ["env-steps", f"rescues per {unit}", "runs"])
    rows = []
    for curve in curves:
        found = curve.rescues
        for index, env_steps in enumerate(curve.env_steps.tolist()):
            ends = float(found.low[index]), float(found.high[index])
            value = Estimate(float(found.mean[index]), *ends)
            shown = format_estimate(value) if found.runs[index] else NONE
            cells = [f"{env_steps:,.0f}", shown, str(found.runs[index])]
            rows.append([curve.method, curve.situation, *cells])
    return plain_table(heads, rows)


def robustness_table(document: Mapping[str, Any]) -> Table:
    """Retention by kind of fault and policy, as a document of `innerattn robustness` holds it."""
    policies = document["policies"]
    heads = columns(["kind of fault"], [one["policy"] for one in policies])
    kinds = list(policies[0]["by_kind"])
    rows = [
        Row(
            (
                "all kinds" if kind == "all" else kind.replace("_", " "),
                *(format_estimate(_estimate(one["by_kind"][kind])) for one in policies),
            ),
            strong=kind == "all",
        )
        for kind in kinds
    ]
    without = [_estimate(one["rescues_per_episode"]) for one in policies]
    rescues = Row(("rescues per episode without a fault", *map(format_estimate, without)))
    note = (
        "Retention: rescues with a fault divided by rescues without it, in the same worlds, from "
        f"the onset on; {document['episodes']} worlds of {document['episode_steps']} steps, seed "
        f"{document['seed']}. Severities: "
        f"{', '.join(format_number(value) for value in document['severities'])}."
    )
    return plain_table(heads, [*rows, rescues], notes=(note,))
