"""Means over runs against those of another library."""

from dataclasses import replace

import pytest
from scipy.stats import ttest_1samp

from innerattn.experiments.run import FinishedRun
from innerattn.experiments.score_means import scores_over_runs
from innerattn.stats import Estimate


def scored(run: FinishedRun, rescues: float, score: float | None) -> FinishedRun:
    """The same run as if it had scored this."""
    own = {
        "rescues_per_episode": Estimate(rescues).to_json(),
        "score": None if score is None else Estimate(score).to_json(),
    }
    long = {**run.summary["long"], **own}
    return replace(run, summary={**run.summary, **own, "long": long})


def test_means_and_intervals(runs: list[FinishedRun]) -> None:
    rescues, scores = [1.0, 2.0, 4.0], [0.2, 0.5, 0.6]
    found = scores_over_runs(
        [scored(runs[0], *values) for values in zip(rescues, scores, strict=True)]
    )
    assert [one.episode_steps for one in found] == [25, 30]
    for one in found:
        for estimate, values in ((one.rescues_per_episode, rescues), (one.score, scores)):
            ends = ttest_1samp(values, 0.0).confidence_interval()
            assert estimate is not None
            assert estimate.mean == pytest.approx(sum(values) / 3)
            assert (estimate.low, estimate.high) == pytest.approx((ends.low, ends.high))


def test_a_run_without_a_score_leaves_none(runs: list[FinishedRun]) -> None:
    for one in scores_over_runs([scored(runs[0], 3.0, 0.4), scored(runs[0], 5.0, None)]):
        assert one.rescues_per_episode is not None
        assert one.rescues_per_episode.mean == 4.0
        assert one.score is None


def test_one_run_has_no_interval(runs: list[FinishedRun]) -> None:
    found, _ = scores_over_runs([scored(runs[0], 2.0, 0.5)])
    assert found.score == Estimate(0.5, runs=1)
