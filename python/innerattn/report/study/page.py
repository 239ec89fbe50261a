"""The page and the document that a study is reported as."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.report.tables.text import plus_minus
from innerattn.stats.estimate import as_json
from innerattn.stats.text import NONE, format_estimate, format_p, format_seeds, format_signed
from innerattn.studies.folder import Rules, StudyFolder
from innerattn.studies.ledger import State
from innerattn.studies.results import RULES, Compared, Mean
from innerattn.studies.study import Value


def study_page(
    study: StudyFolder,
    states: Mapping[str, State],
    found: Sequence[Mean],
    compared: Sequence[Compared],
    failures: Mapping[str, str],
) -> str:
    """The page as Markdown.

    Args:
        study: with its rules over time, which the page prints.
        states: of its runs.
        found: means by place in the grid.
        compared: its contrasts.
        failures: why runs failed, by name.
    """
    counts = Counter(states.values())
    total = f"{counts['done']} of {len(states)} runs are done"
    total += f", {counts['failed']} failed" if counts["failed"] else ""
    parts = [f"# {study.study.question or study.path.name}\n"]
    parts += [f"{sentence(one)}\n" for one in compared]
    parts += [f"{total}.\n"]
    if compared:
        parts += ["## Contrasts\n", markdown(contrasts_table(compared))]
    if found:
        parts += ["## Scores\n", markdown(means_table(found)), _SCORE]
    if failures:
        parts += ["## Failed runs\n", *(f"- {key}: {why}" for key, why in failures.items()), ""]
    parts += ["## Rules\n", RULES, "", *map(_dated, study.rules), ""]
    return "\n".join(parts)


_SCORE = (
    "A score of 0 plays like `random`, a score of 1 like `hungarian`, in the same worlds. ± is "
    "half the 95 % interval over seeds (Student's t).\n"
)


def study_document(
    study: StudyFolder,
    states: Mapping[str, State],
    found: Sequence[Mean],
    compared: Sequence[Compared],
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
        "contrasts": [
            {
                **one.contrast.model_dump(mode="json"),
                "of": {"a": dict(one.a), "b": dict(one.b)},
                "seeds": list(one.seeds),
                "mean": one.mean,
                "difference": as_json(one.found.difference) if one.found else None,
                "p": one.p,
                "holm_p": one.holm_p,
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
            _sides(one),
            f"{one.contrast.measure}, {one.contrast.length}",
            format_seeds(one.seeds) or NONE,
            NONE if one.found is None else format_estimate(one.found.difference),
            format_p(one.holm_p),
            f"{one.contrast.margin:g}",
            one.verdict,
        ]
        for one in compared
    ]
    heads = ["difference [95 %]", "Holm's p", "margin", "verdict"]
    return plain_table(columns(["contrast", "a - b", "measure", "seeds"], heads), rows)


def sentence(one: Compared) -> str:
    """What a contrast says."""
    head = f"**{one.contrast.name}**, {_sides(one)}: {one.verdict}"
    if one.mean is None:
        return f"{head}, no seed has both runs."
    measure = one.contrast.measure.replace("_", " ")
    if one.found is None:
        return f"{head}; {measure} differs by {format_signed(one.mean)} over {_seeds(one)}."
    difference = format_estimate(one.found.difference)
    return f"{head}; {measure} differs by {difference} over {_seeds(one)}."


def _seeds(one: Compared) -> str:
    return f"{len(one.seeds)} seed{'' if len(one.seeds) == 1 else 's'}"


def _sides(one: Compared) -> str:
    """What differs between the two sides, and what they share where that varies."""
    free = {key for key in one.a if one.a[key] != one.b[key]}
    first, second = (
        " ".join(str(side[key]) for key in side if key in free) for side in (one.a, one.b)
    )
    shared = " ".join(str(value) for key, value in one.a.items() if key not in free)
    return f"{first} - {second} ({shared})" if shared else f"{first} - {second}"


def _varied(places: Sequence[Mapping[str, Value]]) -> list[str]:
    """Coordinates that are not the same everywhere."""
    keys = dict.fromkeys(key for place in places for key in place)
    return [key for key in keys if len({place.get(key) for place in places}) > 1]


def _dated(one: Rules) -> str:
    when = "before the first run" if not one.finished else f"after {one.finished} runs were done"
    return f"- Rules {one.digest[:16]} of {one.date}, given {when}."
