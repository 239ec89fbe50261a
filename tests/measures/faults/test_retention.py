"""Retention and its bootstrap, against numbers by hand and a plain loop."""

import numpy as np
import pytest

from innerattn.measures.faults.retention import area, retention
from innerattn.stats.bootstrap import Resampled, resampled_counts


def test_ratios_by_hand() -> None:
    clean = np.array([2, 3, 1])
    faulty = np.array([[2, 3, 1], [1, 2, 0], [0, 0, 0], [4, 6, 2]])
    kept = retention(faulty, clean, resampled_counts(3, seed=0))
    np.testing.assert_allclose(kept.value, [1.0, 0.5, 0.0, 2.0])
    # Where every world keeps the same share, so does every resample.
    for row, share in ((0, 1.0), (2, 0.0), (3, 2.0)):
        np.testing.assert_allclose(kept.resampled[row], share)


def test_the_bootstrap_is_a_loop_over_resampled_worlds() -> None:
    rng = np.random.default_rng(1)
    clean, faulty = rng.poisson(3.0, 40), rng.poisson(2.0, (2, 3, 40))
    weights = resampled_counts(40, seed=2, resamples=50)
    assert (weights.sum(1) == 40).all()
    kept = retention(faulty, clean, weights)
    for b, weight in enumerate(weights):
        worlds = np.repeat(np.arange(40), weight.astype(int))
        expected = faulty[..., worlds].sum(-1) / clean[worlds].sum()
        np.testing.assert_allclose(kept.resampled[..., b], expected)
    np.testing.assert_array_equal(weights, resampled_counts(40, seed=2, resamples=50))


def test_intervals_cover_what_they_should() -> None:
    rng, misses = np.random.default_rng(3), 0
    for seed in range(300):
        clean = rng.poisson(5.0, 60)
        faulty = rng.binomial(clean, 0.7)
        interval = retention(faulty, clean, resampled_counts(60, seed, 500))[()].estimate()
        misses += not interval.low <= 0.7 <= interval.high
    assert 0.02 < misses / 300 < 0.10


def test_nobody_rescued_is_no_number() -> None:
    kept = retention(np.zeros((2, 4)), np.zeros(4), resampled_counts(4, 0, 10))
    assert np.isnan(kept.value).all()
    assert np.isnan(kept.resampled).all()


def test_the_area_by_hand() -> None:
    kept = Resampled(np.array([[0.8, 0.2], [1.0, 1.0]]), np.ones((2, 2, 5)))
    under = area(kept, np.array([0.5, 1.0]), axis=1)
    np.testing.assert_allclose(under.value, [0.5 * 0.9 + 0.5 * 0.5, 1.0])
    np.testing.assert_allclose(under.resampled, 1.0)
    assert under.resampled.shape == (2, 5)


def test_differences_are_paired() -> None:
    rng = np.random.default_rng(0)
    clean = rng.poisson(5.0, 50)
    faulty = rng.binomial(clean, 0.6)
    weights = resampled_counts(50, 0)
    one = retention(faulty, clean, weights)
    nothing = (one - retention(faulty, clean, weights)).estimate()
    assert (nothing.mean, nothing.low, nothing.high) == (0.0, 0.0, 0.0)
    assert one.estimate().low < one.estimate().high


def test_parts_and_means_keep_the_resamples() -> None:
    kept = Resampled(np.arange(6.0).reshape(2, 3), np.arange(24.0).reshape(2, 3, 4))
    assert kept[1, 2].value == 5.0
    np.testing.assert_array_equal(kept[1, 2].resampled, [20, 21, 22, 23])
    assert kept.mean(0).value == pytest.approx([1.5, 2.5, 3.5])
    np.testing.assert_array_equal(kept.mean((0, 1)).resampled, kept.resampled.mean((0, 1)))
