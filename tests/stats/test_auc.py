"""Areas under ROC curves against counting pairs one by one, and against ranks."""

import numpy as np
import pytest
from scipy.stats import rankdata

from innerattn.stats.auc import Comparison, areas, compare
from innerattn.stats.bootstrap import resampled_counts


def scores(episodes: int, samples: int, seed: int, holes: bool = True) -> np.ndarray:
    """(E, n, 2) few different values, so that many are tied."""
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 6, (episodes, samples, 2)) / 3.0
    if holes:
        values[rng.random((episodes, samples)) < 0.3] = np.nan
    return values


def plain(positive: np.ndarray, negative: np.ndarray) -> tuple[float, int]:
    """Pairs won, ties half, and pairs."""
    won, pairs = 0.0, 0
    for p in positive:
        for n in negative:
            if not np.isnan(p) and not np.isnan(n):
                won += 1.0 if p > n else 0.5 if p == n else 0.0
                pairs += 1
    return won, pairs


def test_every_pair_counts_once() -> None:
    positive, negative = scores(4, 6, 0), scores(4, 5, 1)
    found = compare(positive, negative)
    for e in range(4):
        for f in range(4):
            for c in range(2):
                won, pairs = plain(positive[e, :, c], negative[f, :, c])
                assert found.wins[c, e, f] == won
                assert found.pairs[e, f] == pairs


def test_area_is_that_of_the_ranks() -> None:
    positive, negative = scores(20, 9, 0, holes=False) + 0.4, scores(20, 7, 1, holes=False)
    found = areas(compare(positive, negative), resampled_counts(20, seed=0))
    for c, interval in enumerate(found):
        p, n = positive[..., c].ravel(), negative[..., c].ravel()
        u = rankdata(np.concatenate([p, n]))[: len(p)].sum() - len(p) * (len(p) + 1) / 2
        assert interval.mean == pytest.approx(u / (len(p) * len(n)))
        assert interval.low < interval.mean < interval.high


def test_a_resample_takes_whole_episodes_of_both() -> None:
    positive, negative = scores(5, 6, 2), scores(5, 6, 3)
    draws = resampled_counts(5, seed=4, resamples=60)
    expected = []
    for counts in draws.astype(int):
        rows = np.repeat(np.arange(5), counts)
        won, pairs = plain(positive[rows, :, 0].ravel(), negative[rows, :, 0].ravel())
        expected.append(won / pairs)
    interval = areas(compare(positive, negative), draws)[0]
    assert (interval.low, interval.high) == pytest.approx(
        tuple(np.percentile(expected, (2.5, 97.5)))
    )


@pytest.mark.parametrize(("shift", "area"), [(9.0, 1.0), (0.0, 0.5), (-9.0, 0.0)])
def test_clear_cases_and_direction(shift: float, area: float) -> None:
    values = scores(6, 4, 0)
    for interval in areas(compare(values + shift, values), resampled_counts(6, seed=0)):
        assert interval.mean == area
        if shift:
            assert interval.low == interval.high == area
        else:
            assert interval.low <= 0.5 <= interval.high


def test_scores_that_are_all_equal_tell_nothing() -> None:
    constant = np.full((3, 4, 1), 1 / 3)
    (interval,) = areas(compare(constant, constant), resampled_counts(3, seed=0))
    assert (interval.mean, interval.low, interval.high) == (0.5, 0.5, 0.5)


def test_pairs_add_up() -> None:
    one, other = (compare(scores(3, 4, seed), scores(3, 4, seed + 1)) for seed in (0, 5))
    both = one.plus(other)
    assert isinstance(both, Comparison)
    np.testing.assert_array_equal(both.wins, one.wins + other.wins)
    np.testing.assert_array_equal(both.pairs, one.pairs + other.pairs)
