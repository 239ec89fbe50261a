"""The page and the document that a study is reported as."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.report.tables.text import plus_minus
from innerattn.stats.estimate import as_json
from innerattn.stats.text import NONE, format_estimate, format_p, format_seeds, format_signed
from innerattn.studies.aggregates import THRESHOLDS, Aggregate
from innerattn.studies.folder import Rules, StudyFolder
from innerattn.studies.ledger import State
from innerattn.studies.results import RULES, Compared, Mean
from innerattn.studies.study import Length, Value


def study_page(
    study: StudyFolder,
    states: Mapping[str, State],
    found: Sequence[Mean],
    compared: Sequence[Compared],
    failures: Mapping[str, str],
    aggregates: Mapping[Length, Mapping[str, Aggregate]],
) -> str:
    """The page as Markdown.

    Args:
        study: with its rules over time, which the page prints.
        states: of its runs.
        found: means by place in the grid.
        compared: its contrasts.
        failures: why runs failed, by name.
        aggregates: of its algorithms by name, for each length of episodes.
    """
    counts = Counter(states.values())
    total = f"{counts['done']} of {len(states)} runs are done"
    total += f", {counts['failed']} failed" if counts["failed"] else ""
    parts = [f"# {study.study.question or study.path.name}\n"]
    parts += [f"{one}\n" for one in sentences(compared)]
    parts += [f"{total}.\n"]
    if compared:
        parts += ["## Contrasts\n", markdown(contrasts_table(compared))]
    if found:
        parts += ["## Scores\n", markdown(means_table(found)), _SCORE]
    if any(aggregates.values()):
        parts += ["## Over all scenarios\n", markdown(aggregates_table(aggregates)), _AGGREGATES]
    if failures:
        parts += ["## Failed runs\n", *(f"- {key}: {why}" for key, why in failures.items()), ""]
    parts += ["## Rules\n", RULES, "", *map(_dated, study.rules), ""]
    return "\n".join(parts)


_SCORE = (
    "A score of 0 plays like `random`, a score of 1 like `hungarian`, in the same worlds. ± is "
    "half the 95 % interval over seeds (Student's t).\n"
)


_AGGREGATES = (
    "IQM is the interquartile mean of the score over runs and scenarios, with a 95 % interval of a "
    "bootstrap within scenarios. The other columns are the share of runs that score more: a "
    "performance profile (Agarwal et al. 2021). `scores.json` has the scores as rliable takes "
    "them, `marl_eval.json` as marl-eval does. P(a > b) in the contrasts is the probability of "
    "improvement of the same source. With few seeds bootstraps are too sure.\n"
)


def aggregates_table(aggregates: Mapping[Length, Mapping[str, Aggregate]]) -> Table:
    """Interquartile mean and performance profile of every algorithm."""
    rows = [
        [
            name,
            length,
            str(sum(map(len, one.scores.values()))),
            NONE if one.iqm is None else format_estimate(one.iqm),
            *(f"{100.0 * share:.0f} %" for share in one.above),
        ]
        for length, found in aggregates.items()
        for name, one in found.items()
    ]
    heads = ["runs", "IQM [95 %]", *(f"> {threshold:g}" for threshold in THRESHOLDS)]
    return plain_table(columns(["algorithm", "episodes"], heads), rows)


def algorithm_names(found: Sequence[Aggregate]) -> dict[str, Aggregate]:
    """Algorithms by a name of their own: what differs between their places in the grid."""
    varied = _varied([one.algorithm for one in found]) or ["method"]
    return {" ".join(str(one.algorithm[key]) for key in varied): one for one in found}


def study_document(
    study: StudyFolder,
    states: Mapping[str, State],
    found: Sequence[Mean],
    compared: Sequence[Compared],
    aggregates: Mapping[Length, Mapping[str, Aggregate]],
) -> dict[str, Any]:
    """The same as a JSON document."""
    return {
        "schema_version": 1,
        "question": study.study.question,
        "rules": [as_json(one) for one in study.rules],
        "runs": dict(states),
        "means": [
            {
                "place": dict(one.place),
                "seeds": list(one.seeds),
                "values": {
                    f"{measure}.{length}": as_json(value)
                    for (measure, length), value in one.values.items()
                },
            }
            for one in found
        ],
        "over_all_scenarios": [
            {
                "algorithm": dict(one.algorithm),
                "length": length,
                "iqm": as_json(one.iqm),
                "above": dict(zip(map(str, THRESHOLDS), one.above, strict=True)),
            }
            for length, found in aggregates.items()
            for one in found.values()
        ],
        "contrasts": [
            {
                **one.contrast.model_dump(mode="json"),
                "of": {"a": dict(one.a), "b": dict(one.b)},
                "seeds": list(one.seeds),
                "mean": one.mean,
                "difference": as_json(one.found.difference) if one.found else None,
                "p": one.p,
                "holm_p": one.holm_p,
                "improvement": as_json(one.improvement),
                "equivalence_p": one.found.equivalence_p if one.found else None,
                "verdict": one.verdict,
            }
            for one in compared
        ],
    }


def means_table(found: Sequence[Mean]) -> Table:
    """Rescues and scores of every place in the grid."""
    varied = _varied([one.place for one in found]) or ["method"]
    rows = [
        [
            *(str(one.place[key]) for key in varied),
            str(len(one.seeds)),
            *(NONE if value is None else plus_minus(value) for value in one.values.values()),
        ]
        for one in found
    ]
    heads = ["seeds", "rescues/episode", "score", "score, long episodes"]
    return plain_table(columns(varied, heads), rows)


def contrasts_table(compared: Sequence[Compared]) -> Table:
    """Every contrast with its numbers."""
    rows = [
        [
            one.contrast.name,
            sides,
            f"{one.contrast.measure}, {one.contrast.length}",
            format_seeds(one.seeds) or NONE,
            NONE if one.found is None else format_estimate(one.found.difference),
            NONE if one.improvement is None else format_estimate(one.improvement),
            format_p(one.holm_p),
            f"{one.contrast.margin:g}",
            one.verdict,
        ]
        for one, sides in zip(compared, _sides(compared), strict=True)
    ]
    heads = ["difference [95 %]", "P(a > b) [95 %]", "Holm's p", "margin", "verdict"]
    return plain_table(columns(["contrast", "a - b", "measure", "seeds"], heads), rows)


def sentences(compared: Sequence[Compared]) -> list[str]:
    """What each contrast says, in Markdown."""
    return [_sentence(one, sides) for one, sides in zip(compared, _sides(compared), strict=True)]


def _sentence(one: Compared, sides: str) -> str:
    head = f"**{one.contrast.name}**, {sides}: {one.verdict}"
    if one.mean is None:
        return f"{head}, no seed has both runs."
    measure = one.contrast.measure.replace("_", " ")
    if one.found is None:
        return f"{head}; {measure} differs by {format_signed(one.mean)} over {_seeds(one)}."
    difference = format_estimate(one.found.difference)
    return f"{head}; {measure} differs by {difference} over {_seeds(one)}."


def _seeds(one: Compared) -> str:
    return f"{len(one.seeds)} seed{'' if len(one.seeds) == 1 else 's'}"


def _sides(compared: Sequence[Compared]) -> list[str]:
    """What differs between both sides of each contrast, and what they share that others do not."""
    varied = _varied([place for one in compared for place in (one.a, one.b)])
    texts = []
    for one in compared:
        free = [key for key in varied if one.a.get(key) != one.b.get(key)]
        a, b = (" ".join(str(side[key]) for key in free if key in side) for side in (one.a, one.b))
        shared = [str(one.a[key]) for key in varied if key not in free and key in one.a]
        texts.append(f"{a} - {b}" + (f" ({' '.join(shared)})" if shared else ""))
    return texts


def _varied(places: Sequence[Mapping[str, Value]]) -> list[str]:
    """Coordinates that are not the same everywhere."""
    keys = dict.fromkeys(key for place in places for key in place)
    return [key for key in keys if len({place.get(key) for place in places}) > 1]


def _dated(one: Rules) -> str:
    when = "before the first run" if not one.finished else f"after {one.finished} runs were done"
    return f"- Rules {one.digest[:16]} of {one.date}, given {when}."
