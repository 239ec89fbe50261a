"""Intervals against the whole bootstrap distribution, a plain loop and the normal limit."""

import itertools

import numpy as np
import pytest

from innerattn.stats.intervals import (
    mean_interval,
    score_interval,
    student_interval,
)
from innerattn.stats.resampling import resampled_counts, resampled_means


def test_resampling_against_every_possible_resample() -> None:
    values = np.array([0.0, 1.0, 5.0, 2.0])
    every = np.array([np.mean(rows) for rows in itertools.product(values, repeat=4)])
    drawn = resampled_means(values[:, None], seed=0, resamples=200_000)[:, 0]
    assert drawn.mean() == pytest.approx(every.mean(), abs=0.01)
    assert drawn.std() == pytest.approx(every.std(), rel=0.01)
    grid = np.unique(every)
    for value in grid:  # the distribution functions agree to the Monte-Carlo error
        assert np.mean(drawn <= value + 1e-9) == pytest.approx(
            np.mean(every <= value + 1e-9), abs=0.006
        )


def test_interval_of_a_large_sample_is_the_normal_one() -> None:
    values = np.random.default_rng(0).poisson(3, 4000)
    interval = mean_interval(values, seed=1)
    half = 1.96 * values.std() / np.sqrt(len(values))
    assert interval.mean == pytest.approx(values.mean())
    assert interval.low == pytest.approx(values.mean() - half, abs=0.1 * half)
    assert interval.high == pytest.approx(values.mean() + half, abs=0.1 * half)


def test_columns_stay_paired() -> None:
    columns = np.random.default_rng(0).normal(size=(50, 1)) * [1.0, -2.0] + [0.0, 3.0]
    means = resampled_means(columns, seed=0)
    np.testing.assert_allclose(means[:, 1], 3.0 - 2.0 * means[:, 0], atol=1e-12)


def test_counts_of_a_resample_are_those_of_drawing_one_by_one() -> None:
    counts = resampled_counts(5, seed=0, resamples=40_000)
    assert counts.shape == (40_000, 5)
    np.testing.assert_array_equal(counts.sum(1), 5)
    rows = np.random.default_rng(1).integers(0, 5, (40_000, 5))
    plain = np.stack([np.bincount(row, minlength=5) for row in rows])
    for count in range(6):
        share, expected = np.mean(counts == count, 0), np.mean(plain == count, 0)
        np.testing.assert_allclose(share, expected, atol=0.012)
    np.testing.assert_allclose(np.cov(counts.T), np.cov(plain.T), atol=0.03)
    np.testing.assert_array_equal(counts, resampled_counts(5, seed=0, resamples=40_000))
    assert not np.array_equal(counts, resampled_counts(5, seed=1, resamples=40_000))


def test_score_against_a_plain_loop() -> None:
    rng = np.random.default_rng(2)
    method, random, hungarian = rng.poisson([[2.0], [0.2], [3.0]], (3, 300)).astype(float)
    score = score_interval(method, random, hungarian, seed=3)
    assert score is not None
    assert score.mean == pytest.approx(
        (method.mean() - random.mean()) / (hungarian.mean() - random.mean())
    )
    ratios = []
    for _ in range(3000):
        rows = rng.integers(0, 300, 300)
        m, r, h = method[rows].mean(), random[rows].mean(), hungarian[rows].mean()
        ratios.append((m - r) / (h - r))
    low, high = np.percentile(ratios, [2.5, 97.5])
    assert score.low == pytest.approx(low, abs=0.1 * (high - low))
    assert score.high == pytest.approx(high, abs=0.1 * (high - low))


def test_intervals_over_episodes_hold_the_truth_as_often_as_they_say() -> None:
    rng, draws = np.random.default_rng(5), 500
    missed = {"mean": 0, "score": 0}
    for seed in range(draws):
        worlds = rng.normal(0.0, 0.5, 300)  # easy and hard ones, for all policies alike
        played = rng.normal([[2.0], [0.2], [3.0]], 1.0, (3, 300)) + worlds
        mean, score = mean_interval(played[0], seed), score_interval(*played, seed)
        missed["mean"] += not mean.low <= 2.0 <= mean.high
        missed["score"] += score is None or not score.low <= 1.8 / 2.8 <= score.high
    error = 3 * np.sqrt(0.05 * 0.95 / draws)
    assert missed["mean"] / draws == pytest.approx(0.05, abs=error)
    assert missed["score"] / draws == pytest.approx(0.05, abs=error)


def test_score_of_the_scripted_policies_is_exact() -> None:
    rng = np.random.default_rng(4)
    random, hungarian = rng.poisson([[0.2], [3.0]], (2, 200))
    for method, value in ((random, 0.0), (hungarian, 1.0)):
        score = score_interval(method, random, hungarian, seed=0)
        assert score is not None
        assert (score.mean, score.low, score.high) == (value, value, value)


def test_no_score_where_dispatch_is_no_better_than_chance() -> None:
    assert score_interval([1, 2], [1, 1], [1, 1], seed=0) is None
    assert score_interval([1, 2, 0], [0, 0, 0], [0, 0, 1], seed=0) is None


def test_seeds() -> None:
    values = np.arange(30.0)
    assert mean_interval(values, 1) == mean_interval(values, 1)
    assert mean_interval(values, 1) != mean_interval(values, 2)


@pytest.mark.parametrize("values", [[], [[1.0]], 3.0])
def test_what_is_not_a_sample_is_refused(values: object) -> None:
    with pytest.raises(ValueError, match="must be"):
        mean_interval(values, 0)
    with pytest.raises(ValueError, match="must be"):
        score_interval([1.0], [1.0, 2.0], [1.0], 0)


@pytest.mark.parametrize(("n", "quantile"), [(2, 12.7062), (5, 2.7764), (30, 2.0452)])
def test_interval_over_runs_has_the_quantiles_of_the_tables(n: int, quantile: float) -> None:
    values = np.random.default_rng(n).normal(7.0, 2.0, n)
    interval = student_interval(values)
    deviation = np.sqrt(np.sum((values - values.mean()) ** 2) / (n - 1))
    assert interval.mean == pytest.approx(values.mean())
    assert interval.high - interval.mean == pytest.approx(
        quantile * deviation / np.sqrt(n), rel=1e-4
    )
    assert interval.mean - interval.low == pytest.approx(interval.high - interval.mean)


def test_interval_over_few_runs_holds_the_truth_as_often_as_it_says() -> None:
    samples = np.random.default_rng(0).normal(3.0, 1.0, (4000, 4))
    intervals = [student_interval(sample) for sample in samples]
    assert np.mean([x.low <= 3.0 <= x.high for x in intervals]) == pytest.approx(0.95, abs=0.012)


def test_interval_over_runs_needs_two() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        student_interval([1.0])
