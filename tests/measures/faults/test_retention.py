"""Retention and its bootstrap, against numbers by hand and a plain loop."""

import numpy as np
import pytest

from innerattn.measures.faults.retention import area, mean_rescues, retention
from innerattn.stats.bootstrap import Resampled, resampled_counts


def test_ratios_by_hand() -> None:
    clean = np.array([2, 3, 1])
    faulty = np.array([[2, 3, 1], [1, 2, 0], [0, 0, 0], [4, 6, 2]])
    found = retention(faulty, clean, resampled_counts(3, seed=0))
    np.testing.assert_allclose(found.value, [1.0, 0.5, 0.0, 2.0])
    # Where every world keeps the same share, so does every resample.
    for row, share in ((0, 1.0), (2, 0.0), (3, 2.0)):
        np.testing.assert_allclose(found.resampled[row], share)


def test_the_bootstrap_is_a_loop_over_resampled_worlds() -> None:
    rng = np.random.default_rng(1)
    clean, faulty = rng.poisson(3.0, 40), rng.poisson(2.0, (2, 3, 40))
    weights = resampled_counts(40, seed=2, resamples=50)
    assert (weights.sum(1) == 40).all()
    found = retention(faulty, clean, weights)
    for b, weight in enumerate(weights):
        worlds = np.repeat(np.arange(40), weight.astype(int))
        expected = faulty[..., worlds].sum(-1) / clean[worlds].sum()
        np.testing.assert_allclose(found.resampled[..., b], expected)
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
    found = retention(np.zeros((2, 4)), np.zeros(4), resampled_counts(4, 0, 10))
    assert np.isnan(found.value).all()
    assert np.isnan(found.resampled).all()


def test_the_area_by_hand() -> None:
    found = Resampled(np.array([[0.8, 0.2], [1.0, 1.0]]), np.ones((2, 2, 5)))
    under = area(found, np.array([0.5, 1.0]), axis=1)
    np.testing.assert_allclose(under.value, [0.5 * 0.9 + 0.5 * 0.5, 1.0])
    np.testing.assert_allclose(under.resampled, 1.0)
    assert under.resampled.shape == (2, 5)


def test_the_area_of_rescues_begins_with_those_without_a_fault() -> None:
    rescues = Resampled(np.array([[3.0], [1.0]]), np.array([[[3.0, 4.0]], [[1.0, 0.0]]]))
    intact = Resampled(np.asarray(4.0), np.array([4.0, 5.0]))
    under = area(rescues, np.array([0.5, 1.0]), axis=0, intact=intact)
    np.testing.assert_allclose(under.value, [0.5 * 3.5 + 0.5 * 2.0])
    np.testing.assert_allclose(under.resampled, [[0.5 * 3.5 + 0.5 * 2.0, 0.5 * 4.5 + 0.5 * 2.0]])


def test_mean_rescues_by_hand() -> None:
    weights = np.array([[1.0, 1.0, 1.0], [3.0, 0.0, 0.0], [0.0, 1.0, 2.0]])
    found = mean_rescues(np.array([[3, 0, 0], [1, 2, 6]]), weights)
    np.testing.assert_allclose(found.value, [1.0, 3.0])
    np.testing.assert_allclose(found.resampled, [[1.0, 3.0, 0.0], [3.0, 1.0, 14.0 / 3.0]])


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
    found = Resampled(np.arange(6.0).reshape(2, 3), np.arange(24.0).reshape(2, 3, 4))
    assert found[1, 2].value == 5.0
    np.testing.assert_array_equal(found[1, 2].resampled, [20, 21, 22, 23])
    assert found.mean(0).value == pytest.approx([1.5, 2.5, 3.5])
    np.testing.assert_array_equal(found.mean((0, 1)).resampled, found.resampled.mean((0, 1)))
