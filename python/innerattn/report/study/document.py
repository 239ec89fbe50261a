"""The document that a study is reported as: the same as its page, in JSON."""

from __future__ import annotations

from typing import Any

from innerattn.report.study.page import Found
from innerattn.report.study.search import search_document
from innerattn.stats.estimate import as_json
from innerattn.studies.aggregates import THRESHOLDS
from innerattn.studies.curves import LearningCurve
from innerattn.studies.results import Result


def study_document(found: Found) -> dict[str, Any]:
    """The same as a JSON document."""
    study = found.study
    return {
        "schema_version": 2,
        "note": found.note,
        "question": study.study.question,
        "rules": [as_json(one) for one in study.rules],
        "runs": [_listed(one) for one in found.results.finished],
        "left_out": [
            {"place": dict(run.place), "seed": run.seed, "key": run.key, "why": why}
            for run, why in found.results.left_out
        ],
        "tables": {
            title: [
                {
                    "place": dict(one.place),
                    "seeds": list(one.seeds),
                    "values": {
                        f"{measure}.{length}": {
                            "each": list(values.each.values()),
                            "mean": as_json(values.mean),
                        }
                        for (measure, length), values in one.values.items()
                    },
                }
                for one in rows
            ]
            for title, (_, rows) in found.tables.items()
        },
        "search": None if found.search is None else search_document(found.search),
        "curves": {title: [_curve(one) for one in own] for title, own in found.curves.items()},
        "over_all_scenarios": [
            {
                "algorithm": dict(one.algorithm),
                "length": length,
                "iqm": as_json(one.iqm),
                "above": dict(zip(map(str, THRESHOLDS), one.above, strict=True)),
            }
            for length, aggregates in found.aggregates.items()
            for one in aggregates.values()
        ],
        "contrasts": [
            {
                **one.contrast.model_dump(mode="json", exclude_none=True),
                "length": one.length,
                "family": one.family,
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
            for one in found.compared
        ],
    }


def _listed(one: Result) -> dict[str, Any]:
    """What names a run, and what made it."""
    named = {"place": dict(one.run.place), "seed": one.run.seed, "key": one.run.key}
    if one.finished is None:
        return named
    info = one.finished.info
    return named | {
        "folder": f"runs/{one.finished.folder.name}",
        "archived": one.finished.archived,
        "config_sha256": one.finished.config_sha256,
        "weights_sha256": one.finished.weights_sha256,
        "commit": info.commit,
        "device": info.device,
        "versions": info.versions,
    }


def _curve(curve: LearningCurve) -> dict[str, Any]:
    return {
        "situation": curve.situation,
        "method": curve.method,
        "env_steps": curve.env_steps.tolist(),
        "seconds": curve.seconds.tolist(),
        "rescues_per_episode": as_json(curve.rescues),
        "scripts": curve.scripts,
    }
