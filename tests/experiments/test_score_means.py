"""Means over runs against plain ones."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from scipy.stats import ttest_1samp

from innerattn.experiments.plan import PlannedRun, plan
from innerattn.experiments.scan import RunStatus, scan_runs
from innerattn.experiments.score_means import method_scores


@pytest.fixture
def found(study: Path, small: dict[str, object]) -> list[RunStatus]:
    """A run of td-inner and one of td-uniform are finished, two more of each are missing."""
    planned = plan(("td-inner", "td-uniform"), ("mixed",), range(3), "quick", study, small)
    return scan_runs(planned, study)


def set_score(planned: PlannedRun, rescues: float, score: float | None) -> None:
    path = planned.folder / "evaluation" / "summary.json"
    summary = json.loads(path.read_text())
    for part in (summary, summary["long"]):
        part["rescues_per_episode"]["mean"] = rescues
        part["score"] = None if score is None else {"mean": score, "low": score, "high": score}
    path.write_text(json.dumps(summary))


def test_means_and_counts_by_method(found: list[RunStatus]) -> None:
    assert [one.state for one in found].count("finished") == 2
    for one in found:
        if one.state == "finished":
            set_score(one.planned, 2.0, None)
    inner, uniform = method_scores(found)
    assert (inner.situation, inner.method, inner.used, inner.planned) == ("mixed", "td-inner", 1, 3)
    assert uniform.method == "td-uniform"
    assert inner.mean is not None
    standard, long = inner.mean
    assert (standard.episode_steps, long.episode_steps) == (25, 5)
    assert standard.rescues_per_episode is not None
    assert (standard.rescues_per_episode.mean, standard.rescues_per_episode.low) == (2.0, None)
    assert standard.score is None  # one run without a score leaves none
    missing = [one for one in found if one.state != "finished"]
    assert [(one.used, one.mean) for one in method_scores(missing)] == [(0, None), (0, None)]


def test_several_runs_have_an_interval(found: list[RunStatus], tmp_path: Path) -> None:
    (run, *_) = [one for one in found if one.state == "finished"]
    runs, rescues, scores = [], [1.0, 2.0, 4.0], [0.2, 0.5, 0.6]
    for number, values in enumerate(zip(rescues, scores, strict=True)):
        folder = Path(shutil.copytree(run.planned.folder, tmp_path / str(number)))
        runs.append(RunStatus(replace(run.planned, folder=folder), "finished"))
        set_score(runs[-1].planned, *values)
    (inner,) = method_scores(runs)
    assert inner.used == 3
    assert inner.mean is not None
    for one in inner.mean:
        for estimate, values in ((one.rescues_per_episode, rescues), (one.score, scores)):
            ends = ttest_1samp(values, 0.0).confidence_interval()
            assert estimate is not None
            assert estimate.mean == pytest.approx(sum(values) / 3)
            assert (estimate.low, estimate.high) == pytest.approx((ends.low, ends.high))
