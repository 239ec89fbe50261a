"""Shuffled labels against every possible labelling, and the rate of false positives."""

from itertools import product

import numpy as np
import pytest

from innerattn.measures.faults.label_shuffle import shuffled_labels


def changes(episodes: int, robots: int, seed: int, common: float = 0.0) -> np.ndarray:
    """(E, R, R) rows that sum to 0; `common` is how much all robots turn to the same one."""
    rng = np.random.default_rng(seed)
    turned = common * rng.normal(size=(episodes, 1, robots))
    drawn = turned + (1 - common) * rng.normal(size=(episodes, robots, robots))
    others = ~np.eye(robots, dtype=bool)
    drawn = np.where(others, drawn, 0.0)
    return np.where(others, drawn - drawn.sum(2, keepdims=True) / (robots - 1), 0.0)


def plain_gain(change: np.ndarray, failing: int, called: int) -> float:
    """Change of the weight on the labelled robot, the row of the failing one left out."""
    robots = len(change)
    return float(np.mean([change[i, called] for i in range(robots) if i not in (failing, called)]))


def test_against_every_labelling() -> None:
    change, failing = changes(4, 3, seed=0), 1
    change[:, [0, 2], failing] += 0.5
    every = np.array(
        [
            np.mean([plain_gain(change[e], failing, k) for e, k in enumerate(labels)])
            for labels in product(range(3), repeat=4)
        ]
    )
    observed = np.mean([plain_gain(row, failing, failing) for row in change])
    interval, p_value = shuffled_labels(change, failing, seed=0, shuffles=200_000)
    assert interval.mean == pytest.approx(every.mean(), abs=0.005)
    exact = 2.0 * np.mean(every >= observed - 1e-12)
    assert p_value == pytest.approx(exact, abs=0.004)
    assert 0.01 < exact < 0.5


def test_a_clear_gain_has_the_smallest_p_value() -> None:
    change = 0.1 * changes(30, 4, seed=1)
    change[:, :, 2] += 1.0
    interval, p_value = shuffled_labels(change, 2, seed=0, shuffles=199)
    assert p_value == 2 / 200
    assert interval.high < 1.0
    assert shuffled_labels(-change, 2, seed=0, shuffles=199)[1] == 2 / 200


@pytest.mark.parametrize("common", [0.0, 0.5, 1.0])
def test_few_are_significant_without_an_effect(common: float) -> None:
    p_values = [
        shuffled_labels(changes(20, 4, seed, common), seed % 4, seed, shuffles=199)[1]
        for seed in range(300)
    ]
    assert 0.005 <= np.mean(np.array(p_values) <= 0.05) <= 0.08


def test_nothing_moves() -> None:
    interval, p_value = shuffled_labels(np.zeros((3, 4, 4)), 0, seed=0)
    assert (interval.mean, interval.low, interval.high, p_value) == (0.0, 0.0, 0.0, 1.0)


def test_seeds() -> None:
    change = changes(8, 4, seed=3)
    assert shuffled_labels(change, 0, seed=5) == shuffled_labels(change, 0, seed=5)
    assert shuffled_labels(change, 0, seed=5) != shuffled_labels(change, 0, seed=6)


@pytest.mark.parametrize("robots", [1, 2])
def test_a_choice_needs_three(robots: int) -> None:
    with pytest.raises(ValueError, match="at least 3"):
        shuffled_labels(np.zeros((2, robots, robots)), 0, seed=0)
