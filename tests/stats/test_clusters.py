"""Shares and ratios of clustered events against statsmodels, plain loops and simulation."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.stats import norm
from scipy.stats import t as student
from statsmodels.api import OLS
from statsmodels.stats.proportion import proportion_confint

from innerattn.stats import Estimate
from innerattn.stats.clusters import ratio_interval, ratio_intervals, share_interval, share_of


def clustered(rng: np.random.Generator, share: float, correlation: float) -> np.ndarray:
    """Beta-binomial hits and events of 80 episodes with 1.5 events on average, (80, 2)."""
    events = rng.poisson(1.5, 80)
    chance = np.full(80, share)
    if correlation:
        scale = (1 - correlation) / correlation
        chance = rng.beta(share * scale, (1 - share) * scale, 80)
    return np.stack([rng.binomial(events, chance), events], 1)


def as_events(hits: np.ndarray, events: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One row per event: hit or not, and its episode."""
    hit = [np.repeat([1.0, 0.0], [x, n - x]) for x, n in zip(hits, events, strict=True)]
    return np.concatenate(hit), np.repeat(np.arange(len(events)), events)


def test_by_hand() -> None:
    # Three episodes with events, 5 hits of 8; residuals x - n 5/8 are -1/4, 3/4, -1/2.
    share = share_of([1, 0, 2, 2], [2, 0, 2, 4])
    assert share is not None
    assert (share.share, share.episodes) == (0.625, 3)
    variance = 3 / 2 * (1 / 16 + 9 / 16 + 4 / 16) / 64
    assert share.effective_events == pytest.approx(0.625 * 0.375 / variance)


@pytest.mark.parametrize("share", [0.5, 0.8])
def test_variance_and_interval_against_statsmodels(share: float) -> None:
    hits, events = clustered(np.random.default_rng(0), share, 0.3).T
    found = share_of(hits, events)
    assert found is not None
    hit, episode = as_events(hits, events)
    fit = OLS(hit, np.ones_like(hit)).fit(cov_type="cluster", cov_kwds={"groups": episode})
    p, n = fit.params[0], found.effective_events
    assert found.share == pytest.approx(p)
    assert n == pytest.approx(p * (1 - p) / fit.bse[0] ** 2)
    mean, low, high = ratio_intervals(hits.astype(float), events.astype(float))
    quantile = student.ppf(0.975, np.sum(events > 0) - 1)
    assert (float(mean), float(low), float(high)) == pytest.approx(
        (p, p - quantile * fit.bse[0], p + quantile * fit.bse[0])
    )
    # Wilson's interval at the level at which the normal quantile is Student's.
    alpha = 2 * norm.sf(quantile)
    interval = found.estimate()
    assert (interval.low, interval.high) == pytest.approx(
        proportion_confint(p * n, n, alpha=alpha, method="wilson"), abs=1e-9
    )


@example([(0, 1)] * 3, 0.9)
@example([(1, 0)] * 3, 0.9)
@given(
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=2, max_size=12),
    st.sampled_from([0.8, 0.9, 0.95]),
)
def test_interval_and_tests_agree(rows: list[tuple[int, int]], level: float) -> None:
    counts = np.array(rows)
    share = share_of(counts[:, 0], counts.sum(1))
    if share is None:
        assert counts.sum() == 0
        return
    interval = share.estimate(level)
    low, high = interval.low, interval.high
    assert interval.mean == share.share
    assert 0.0 <= low <= share.share <= high <= 1.0
    for bound in (0.2, 0.4, 0.6):
        if abs(low - bound) > 1e-9:
            assert (share.p_above(bound) < (1 - level) / 2) == (low > bound)
        if abs(high - bound) > 1e-9:
            assert (share.p_below(bound) < (1 - level) / 2) == (high < bound)


def test_episodes_alike_count_as_one_event_each() -> None:
    # Three hits of nine, always one of three: rounding must not make that a variance.
    for hits, events in (([1, 1, 1], [3, 3, 3]), ([2, 2, 2], [2, 2, 2]), ([0] * 3, [1] * 3)):
        share = share_of(hits, events)
        assert share is not None
        assert share.effective_events == 3
    all_hits = share_of([1] * 50, [1] * 50)
    assert all_hits is not None
    interval = all_hits.estimate()
    assert interval.high == 1.0
    t = student.ppf(0.975, 49)
    assert interval.low == pytest.approx(50 / (50 + t * t))


def test_one_episode_and_none() -> None:
    assert share_of([0, 0], [0, 0]) is None
    assert share_interval([0], [0]) is None
    alone = share_of([3, 0], [4, 0])
    assert alone is not None
    assert alone.estimate() == Estimate(0.75, 0.0, 1.0)
    assert (alone.p_above(0.1), alone.p_below(0.9)) == (1.0, 1.0)
    assert ratio_interval([3.0, 0.0], [4, 0]) is None
    mean, low, high = ratio_intervals(np.array([[3.0, 0], [0, 0]]), np.array([[4.0, 0], [0, 0]]))
    np.testing.assert_array_equal(mean, [0.75, np.nan])
    assert np.isnan([low, high]).all()


@pytest.mark.parametrize(
    ("hits", "events"),
    [([1.0], [1.0]), ([2], [1]), ([-1], [1]), ([1, 1], [1]), ([[1]], [[1]])],
)
def test_what_is_no_count_is_refused(hits: object, events: object) -> None:
    with pytest.raises(ValueError, match="must be"):
        share_of(hits, events)


@pytest.mark.parametrize("correlation", [0.0, 0.3])
@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
def test_interval_misses_as_often_as_it_says(share: float, correlation: float) -> None:
    rng = np.random.default_rng(7)
    intervals = [share_interval(*clustered(rng, share, correlation).T) for _ in range(3000)]
    missed = np.mean([x is not None and not x.low <= share <= x.high for x in intervals])
    # Near a share of 1 counts are so few that no interval of them is exact; short it must not be.
    assert missed < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 3000)
    if share < 0.9:
        assert missed > 0.05 - 3 * np.sqrt(0.05 * 0.95 / 3000)


def test_mean_over_few_episodes_holds_the_truth_where_percentiles_do_not() -> None:
    rng = np.random.default_rng(1)
    missed = {"t": 0, "percentiles": 0}
    for _ in range(1500):
        events = rng.integers(1, 4, 8)
        sums = events * rng.normal(2.0, 1.0, 8) + rng.normal(0.0, np.sqrt(events))
        interval = ratio_interval(sums, events)
        assert interval is not None
        missed["t"] += not interval.low <= 2.0 <= interval.high
        rows = rng.integers(0, 8, (400, 8))
        low, high = np.percentile(sums[rows].sum(1) / events[rows].sum(1), (2.5, 97.5))
        missed["percentiles"] += not low <= 2.0 <= high
    assert missed["t"] / 1500 == pytest.approx(0.05, abs=3 * np.sqrt(0.05 * 0.95 / 1500))
    assert missed["percentiles"] / 1500 > 0.11
