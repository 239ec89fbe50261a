"""Interquartile means and probabilities of improvement against scipy, loops and simulation."""

import itertools

import numpy as np
import pytest
from scipy.stats import mannwhitneyu, trim_mean

from innerattn.stats import aggregate
from innerattn.stats.aggregate import improvement_interval, interquartile_mean, iqm_interval


@pytest.mark.parametrize("n", [1, 3, 4, 7, 8, 10, 33])
def test_interquartile_mean_is_scipys_trimmed_mean(n: int) -> None:
    values = np.random.default_rng(n).normal(size=n)
    assert interquartile_mean(values) == pytest.approx(trim_mean(values, 0.25))


def test_interquartile_mean_by_hand() -> None:
    assert interquartile_mean([100.0, 1.0, 2.0, 3.0, -50.0, 4.0, 5.0, 6.0]) == 3.5
    assert interquartile_mean([1.0, 2.0, 6.0]) == 3.0


def test_interval_against_every_possible_resample() -> None:
    strata = np.random.default_rng(3).normal(size=(2, 4))
    rows = np.array(list(itertools.product(range(4), repeat=4)))
    one, other = (values[rows] for values in strata)
    every = np.concatenate([np.repeat(one, 256, 0), np.tile(other, (256, 1))], 1)
    interval = iqm_interval(list(strata), seed=0)
    assert interval.mean == pytest.approx(trim_mean(strata.ravel(), 0.25))
    low, high = np.percentile(trim_mean(every, 0.25, axis=1), (2.5, 97.5))
    assert interval.low == pytest.approx(low, abs=0.03 * (high - low))
    assert interval.high == pytest.approx(high, abs=0.03 * (high - low))


def test_improvement_against_mann_and_whitney_and_a_plain_loop() -> None:
    rng = np.random.default_rng(1)
    x = [rng.integers(0, 9, n).astype(float) for n in (5, 7)]
    y = [rng.integers(0, 8, n).astype(float) for n in (6, 4)]
    interval = improvement_interval(x, y, seed=2)
    u = [mannwhitneyu(a, b).statistic / (len(a) * len(b)) for a, b in zip(x, y, strict=True)]
    assert interval.mean == pytest.approx(np.mean(u))
    drawn = []
    for _ in range(2000):
        strata = []
        for a, b in zip(x, y, strict=True):
            ours, theirs = rng.choice(a, len(a)), rng.choice(b, len(b))
            wins = sum((i > j) + 0.5 * (i == j) for i in ours for j in theirs)
            strata.append(wins / (len(a) * len(b)))
        drawn.append(np.mean(strata))
    low, high = np.percentile(drawn, (2.5, 97.5))
    assert interval.low == pytest.approx(low, abs=0.08 * (high - low))
    assert interval.high == pytest.approx(high, abs=0.08 * (high - low))


def test_clear_improvement_and_its_mirror() -> None:
    better, worse = [[3.0, 4.0]], [[1.0, 2.0, 2.5]]
    assert improvement_interval(better, worse, 0).low == 1.0
    assert improvement_interval(worse, better, 0).high == 0.0
    assert improvement_interval(better, better, 0).mean == 0.5


def test_seeds() -> None:
    strata = [np.random.default_rng(0).normal(size=9)]
    assert iqm_interval(strata, 1) == iqm_interval(strata, 1)
    assert iqm_interval(strata, 1) != iqm_interval(strata, 2)


@pytest.mark.parametrize("bad", [[], [[1.0]], [[[1.0, 2.0]]], [[1.0, np.nan]]])
def test_what_is_no_stratum_is_refused(bad: list) -> None:
    for call in (
        lambda: iqm_interval(bad, 0),
        lambda: improvement_interval(bad, [[1.0, 2.0]], 0),
    ):
        with pytest.raises(ValueError, match="must be"):
            call()
    with pytest.raises(ValueError, match="x has 1 strata, y 2"):
        improvement_interval([[1.0, 2.0]], [[1.0, 2.0]] * 2, 0)
    with pytest.raises(ValueError, match="1 or more"):
        interquartile_mean([])


@pytest.mark.long
@pytest.mark.parametrize(("runs", "least", "most"), [(3, 0.08, 0.18), (15, 0.02, 0.085)])
def test_intervals_are_short_where_strata_hold_few_runs(
    runs: int, least: float, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(aggregate, "_RESAMPLES", 600)
    rng, draws = np.random.default_rng(4), 400
    missed = np.zeros(2)
    for seed in range(draws):
        x = rng.normal(size=(3, runs))
        y = rng.normal(-0.7416, size=(3, runs))  # P(X > Y) = 0.7
        iqm, better = iqm_interval(x, seed), improvement_interval(x, y, seed)
        missed += [
            not iqm.low <= 0.0 <= iqm.high,
            not better.low <= 0.7 <= better.high,
        ]
    assert np.all((least < missed / draws) & (missed / draws < most))
