"""Intervals against the whole bootstrap distribution, a plain loop and the normal limit."""

import itertools

import numpy as np
import pytest

from innerattn.stats import Estimate
from innerattn.stats.bootstrap import (
    Resampled,
    bootstrap,
    mean_interval,
    resampled_counts,
    score_interval,
)


def test_resampling_against_every_possible_resample() -> None:
    values = np.array([0.0, 1.0, 5.0, 2.0])
    every = np.array([np.mean(rows) for rows in itertools.product(values, repeat=4)])
    drawn = bootstrap([values], np.mean, seed=0, resamples=200_000)
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


def means(*samples: np.ndarray, axis: int) -> np.ndarray:
    return np.stack([sample.mean(axis) for sample in samples])


def test_samples_stay_paired_where_they_are() -> None:
    sample = np.random.default_rng(0).normal(size=50)
    one, other = bootstrap([sample, 3.0 - 2.0 * sample], means, seed=0, paired=True)
    np.testing.assert_allclose(other, 3.0 - 2.0 * one, atol=1e-12)
    one, other = bootstrap([sample, 3.0 - 2.0 * sample], means, seed=0)
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.1


def test_a_single_episode_is_drawn_every_time() -> None:
    assert mean_interval([4.0], seed=0) == Estimate(4.0, 4.0, 4.0)
    resampled = bootstrap([np.ones(1), np.zeros(1)], means, seed=0, resamples=5, paired=True)
    np.testing.assert_array_equal(resampled, [[1.0] * 5, [0.0] * 5])


def test_many_episodes_are_drawn_in_parts_alike() -> None:
    values = np.random.default_rng(0).normal(size=(2**21 // 1500) + 1)
    plain = np.random.default_rng(3)  # 1,499 resamples at once
    rows = [plain.integers(0, len(values), (count, len(values))) for count in (1499, 501)]
    expected = values[np.concatenate(rows)].mean(1)
    drawn = bootstrap([values], np.mean, seed=3, resamples=2000)
    np.testing.assert_array_equal(drawn, expected)


def test_an_interval_is_unbounded_where_a_resample_has_no_value() -> None:
    one = Resampled(np.array([1.0, 2.0]), np.array([[0.5, 1.5, 1.0], [2.0, np.nan, 2.0]]))
    assert one[0].estimate().bounded
    assert one[1].estimate() == Estimate(2.0)
    assert one.mean(0).estimate() == Estimate(1.5)


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


@pytest.mark.long
def test_intervals_over_episodes_hold_the_truth_as_often_as_they_say() -> None:
    rng, draws = np.random.default_rng(5), 500
    missed = {"mean": 0, "score": 0}
    for seed in range(draws):
        worlds = rng.normal(0.0, 0.5, 100)  # easy and hard ones, for all policies alike
        played = rng.normal([[2.0], [0.2], [3.0]], 1.0, (3, 100)) + worlds
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
