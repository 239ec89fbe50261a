"""Means over runs against those of another library."""

from dataclasses import replace
from pathlib import Path

import pytest
from scipy.stats import ttest_1samp

from innerattn.experiments.plan import plan
from innerattn.experiments.run import FinishedRun
from innerattn.experiments.scan import RunStatus
from innerattn.experiments.score_means import method_scores
from innerattn.stats import Estimate


def scored(run: FinishedRun, rescues: float, score: float | None) -> FinishedRun:
    """The same run as if it had scored this."""
    own = {
        "rescues_per_episode": Estimate(rescues).to_json(),
        "score": None if score is None else Estimate(score).to_json(),
    }
    long = {**run.summary["long"], **own}
    return replace(run, summary={**run.summary, **own, "long": long})


def statuses(runs: list[FinishedRun | None], method: str) -> list[RunStatus]:
    planned = plan((method,), ("mixed",), range(len(runs)), "quick", Path("study"))
    return [
        RunStatus(one, "finished" if run else "missing", run=run)
        for one, run in zip(planned, runs, strict=True)
    ]


def test_means_and_intervals_by_method(runs: list[FinishedRun]) -> None:
    rescues, scores = [1.0, 2.0, 4.0], [0.2, 0.5, 0.6]
    inner = [scored(runs[0], *values) for values in zip(rescues, scores, strict=True)]
    found = [
        *statuses([*inner, None], "td-inner"),
        *statuses([scored(runs[0], 3.0, 0.4), scored(runs[0], 5.0, None)], "td-uniform"),
        *statuses([None], "ppo-inner"),
    ]
    of_inner, of_uniform, of_ppo = method_scores(found)
    assert (of_inner.situation, of_inner.method) == ("mixed", "td-inner")
    assert [(one.used, one.planned) for one in (of_inner, of_uniform, of_ppo)] == [
        (3, 4),
        (2, 2),
        (0, 1),
    ]
    assert of_inner.mean is not None
    assert [one.episode_steps for one in of_inner.mean] == [25, 30]
    for one in of_inner.mean:
        for estimate, values in ((one.rescues_per_episode, rescues), (one.score, scores)):
            ends = ttest_1samp(values, 0.0).confidence_interval()
            assert estimate is not None
            assert estimate.mean == pytest.approx(sum(values) / 3)
            assert (estimate.low, estimate.high) == pytest.approx((ends.low, ends.high))
    assert of_uniform.mean is not None
    for one in of_uniform.mean:
        assert one.rescues_per_episode is not None
        assert one.rescues_per_episode.mean == 4.0
        assert one.score is None  # a run without a score leaves none
    assert of_ppo.mean is None


def test_one_run_has_no_interval(runs: list[FinishedRun]) -> None:
    (found,) = method_scores(statuses([scored(runs[0], 2.0, 0.5)], "td-inner"))
    assert found.mean is not None
    assert found.mean[0].score == Estimate(0.5, runs=1)
