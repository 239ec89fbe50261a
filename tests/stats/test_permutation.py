"""Permutation tests against every permutation, written out."""

from itertools import permutations, product

import numpy as np
import pytest

from innerattn.stats.permutation import permutation_test


def two_sided(every: np.ndarray, observed: float) -> float:
    """Twice the smaller share of permutations at least as far on one side."""
    tails = (np.mean(every <= observed + 1e-12), np.mean(every >= observed - 1e-12))
    return float(min(1.0, 2.0 * min(tails)))


def total(*samples: np.ndarray, axis: int) -> np.ndarray:
    return samples[0].sum(axis)


@pytest.mark.parametrize("drawn", [False, True])
def test_signs(drawn: bool) -> None:
    values = np.random.default_rng(0).normal(0.4, 1.0, 6)
    every = np.array([np.dot(signs, values) for signs in product((1.0, -1.0), repeat=6)])
    test = permutation_test([values], total, "samples", 0, 63 if drawn else 64)
    assert len(test.null) == (63 if drawn else 64)
    exact = two_sided(every, values.sum())
    assert test.p == pytest.approx(exact, abs=0.15 if drawn else 1e-12)
    if not drawn:
        np.testing.assert_allclose(np.sort(test.null), np.sort(every))


def test_pairings() -> None:
    x, y = np.random.default_rng(1).normal(size=(2, 5))
    every = np.array([np.dot(x, y[list(order)]) for order in permutations(range(5))])
    test = permutation_test([y], lambda other, axis: (x * other).sum(axis), "pairings", 0, 200)
    np.testing.assert_allclose(np.sort(test.null), np.sort(every))
    assert test.p == pytest.approx(two_sided(every, float(x @ y)))


def test_labels_within_observations() -> None:
    values = np.random.default_rng(2).normal(size=(3, 3))  # (E, k)
    labels = product(range(3), repeat=3)
    every = np.array([sum(values[e, k] for e, k in enumerate(of)) for of in labels])
    test = permutation_test(list(values.T), total, "samples", 0, 1000)
    assert len(test.null) == 6**3  # every order of the three labels, so each label alike often
    assert test.p == pytest.approx(two_sided(every, values[:, 0].sum()))


def test_drawn_permutations_are_fixed_by_the_seed_and_never_give_zero() -> None:
    values = np.full(30, 1.0)
    one, other = (permutation_test([values], total, "samples", 5, 99) for _ in range(2))
    assert one.p == other.p == pytest.approx(2 / 100)
    np.testing.assert_array_equal(one.null, other.null)
    third = permutation_test([values], total, "samples", 6, 99)
    assert not np.array_equal(one.null, third.null)
