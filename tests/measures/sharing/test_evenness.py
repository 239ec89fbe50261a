"""Evenness by hand, against plain loops, and how often its verdicts are false."""

import json

import numpy as np
import pytest
from scipy.stats import t as student
from scipy.stats import ttest_1samp

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.measures.cooperation import count_cooperation
from innerattn.measures.sharing.evenness import (
    EvennessOfRuns,
    counts_by_episode,
    evenness,
    evenness_of_runs,
)
from innerattn.policies import scripted_policy
from innerattn.stats.estimate import as_json


def counts(
    rng: np.random.Generator, share: float, correlation: float = 0.1, episodes: int = 80
) -> np.ndarray:
    """Beta-binomial rescues by two robots, 1.5 in an episode on average, (episodes, 2)."""
    rescues = rng.poisson(1.5, episodes)
    if correlation == 0.0:
        first = rng.binomial(rescues, share)
        return np.stack([first, rescues - first], 1)
    scale = (1 - correlation) / correlation
    first = rng.binomial(rescues, rng.beta(share * scale, (1 - share) * scale, episodes))
    return np.stack([first, rescues - first], 1)


def within(rate: float, true_rate: float, draws: int) -> bool:
    return abs(rate - true_rate) < 3 * np.sqrt(true_rate * (1 - true_rate) / draws)


def test_chi_squared_by_hand() -> None:
    # 60 and 40: (60 - 50)²/50 twice is 4, whose p is 0.0455; 55 and 45 give 1, 0.3173.
    for first, statistic, p, rejected in ((60, 4.0, 0.0455, True), (55, 1.0, 0.3173, False)):
        table = np.zeros((100, 2), int)
        table[:first, 0], table[first:, 1] = 1, 1
        found = evenness(table)
        assert found.rescues == (first, 100 - first)
        assert found.chi_squared is not None
        assert found.chi_squared.statistic == pytest.approx(statistic)
        assert found.chi_squared.p == pytest.approx(p, abs=5e-5)
        assert found.chi_squared.rejected is rejected


def test_independent_rescues_have_wilsons_interval() -> None:
    table = np.zeros((100, 2), int)
    table[:55, 0], table[55:, 1] = 1, 1
    found = evenness(table)
    p, n = 0.55, 99.0  # n - 1, since the variance is estimated
    for level, interval in ((0.95, found.share), (0.9, found.interval_90)):
        assert interval is not None
        low, high = (interval.low, interval.high) if level == 0.95 else interval
        t = student.ppf((1 + level) / 2, 99)
        for end in (low, high):  # both solve |p - q| = t sqrt(q (1 - q) / n)
            assert abs(p - end) == pytest.approx(t * np.sqrt(end * (1 - end) / n))
    deviation = np.sqrt(0.24 / n)
    assert found.equivalence_p == pytest.approx(student.cdf(-(0.6 - p) / deviation, 99))


@pytest.mark.parametrize(
    ("table", "verdict"),
    [
        ([[1, 1]] * 80, "even"),
        ([[2, 0], [0, 2]] * 200, "even"),
        ([[1, 1]] * 3, "undecided"),
        ([[2, 0]] * 80, "uneven"),
        ([[0, 2]] * 80, "uneven"),
        ([[2, 0]] * 2, "undecided"),
        ([[40, 0]], "undecided"),
        ([[4, 0]] * 20 + [[0, 4]] * 20, "undecided"),
        ([[0, 0]] * 80, "undecided"),
    ],
)
def test_verdicts(table: list[list[int]], verdict: str) -> None:
    assert evenness(table).verdict == verdict


def test_verdict_tests_and_intervals_are_one() -> None:
    rng = np.random.default_rng(0)
    seen = set()
    for share in (0.5, 0.55, 0.7, 0.8):
        for _ in range(60):
            found = evenness(counts(rng, share))
            assert found.interval_90 is not None
            assert found.equivalence_p is not None
            assert found.share is not None
            inside = found.interval_90[0] > 0.4 and found.interval_90[1] < 0.6
            assert inside == (found.equivalence_p < 0.05) == (found.verdict == "even")
            outside = found.share.low > 0.6 or found.share.high < 0.4
            assert outside == (found.verdict == "uneven")
            seen.add(found.verdict)
    assert seen == {"even", "uneven", "undecided"}


def test_interval_is_that_of_resampled_episodes_where_these_are_many() -> None:
    table = counts(np.random.default_rng(3), 0.6, 0.4, episodes=1500)
    found = evenness(table)
    assert found.share is not None
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(2000):
        drawn = table[rng.integers(0, len(table), len(table))]
        shares.append(drawn[:, 0].sum() / drawn.sum())
    low, high = np.percentile(shares, (2.5, 97.5))
    assert found.share.mean == pytest.approx(table[:, 0].sum() / table.sum())
    assert found.share.low == pytest.approx(low, abs=0.1 * (high - low))
    assert found.share.high == pytest.approx(high, abs=0.1 * (high - low))


def test_no_rescues() -> None:
    found = evenness([[0, 0], [0, 0]])
    assert (found.rescues, found.episodes, found.verdict) == ((0, 0), 2, "undecided")
    assert found.share is found.chi_squared is found.interval_90 is found.equivalence_p is None
    assert json.loads(json.dumps(as_json(found), allow_nan=False))["share"] is None


def test_episodes_without_rescues_change_nothing_else() -> None:
    table = counts(np.random.default_rng(1), 0.5)
    more = evenness(np.concatenate([table, np.zeros((40, 2), int)]))
    assert more.episodes == 120
    one, other = as_json(more) | {"episodes": 80}, as_json(evenness(table))
    assert one == other


@pytest.mark.parametrize(
    "bad", [[1, 2], [[1, 2, 3]], [[0.5, 1.0]], [[-1, 1]], np.zeros((0, 2), int)]
)
def test_what_is_no_table_is_refused(bad: object) -> None:
    with pytest.raises(ValueError, match=r"must be \(E, 2\)"):
        evenness(bad)


DRAWS = 800


@pytest.mark.parametrize("correlation", [0.0, 0.05, 0.3])
def test_even_work_is_taken_for_another_as_often_as_it_says(correlation: float) -> None:
    rng = np.random.default_rng(11)
    found = [evenness(counts(rng, 0.5, correlation)) for _ in range(DRAWS)]
    missed = np.mean([not (x.share and x.share.low <= 0.5 <= x.share.high) for x in found])
    assert within(missed, 0.05, DRAWS)
    assert np.mean([x.verdict == "uneven" for x in found]) < 0.005


@pytest.mark.parametrize(("share", "correlation"), [(0.6, 0.001), (0.4, 0.1), (0.6, 0.3)])
def test_uneven_work_is_rarely_found_even(share: float, correlation: float) -> None:
    rng = np.random.default_rng(12)
    found = [evenness(counts(rng, share, correlation)) for _ in range(DRAWS)]
    # At the margin each verdict is false in one tail; few clustered rescues make it cautious.
    rate = np.mean([x.verdict == "even" for x in found])
    assert within(rate, 0.05, DRAWS) or (correlation == 0.3 and 0.02 < rate < 0.05)
    assert within(np.mean([x.verdict == "uneven" for x in found]), 0.025, DRAWS)


def test_chi_squared_rejects_independent_even_work_as_often_as_it_says() -> None:
    rng = np.random.default_rng(14)
    found = [evenness(counts(rng, 0.5, 0.0)).chi_squared for _ in range(4 * DRAWS)]
    assert within(np.mean([x is not None and x.rejected for x in found]), 0.05, 4 * DRAWS)


def test_chi_squared_alone_is_too_sure_of_clustered_rescues() -> None:
    rng = np.random.default_rng(13)
    found = [evenness(counts(rng, 0.5, 0.4)).chi_squared for _ in range(DRAWS)]
    assert np.mean([x is not None and x.rejected for x in found]) > 0.08


def runs_of(rng: np.random.Generator, runs: int, share: float, scatter: float) -> EvennessOfRuns:
    scale = share * (1 - share) / scatter**2 - 1
    shares = rng.beta(share * scale, (1 - share) * scale, runs)
    return evenness_of_runs([counts(rng, chance) for chance in shares], 0)


def test_runs_by_hand() -> None:
    found = evenness_of_runs([[[3, 1], [0, 0]], [[1, 1], [1, 1]], [[0, 0]]], seed=0)
    assert [run.rescues for run in found.runs] == [(3, 1), (2, 2), (0, 0)]
    assert found.rescues == (5, 3)
    assert found.verdicts == {"even": 0, "uneven": 0, "undecided": 3}
    assert found.share is not None
    assert found.share.mean == pytest.approx((0.75 + 0.5) / 2)  # the run without rescues has none
    assert found.share.high - found.share.mean == pytest.approx(student.ppf(0.975, 1) * 0.125)
    assert found.pooled_share is not None
    assert found.pooled_share.mean == pytest.approx(5 / 8)
    assert found.chi_squared is not None
    assert found.chi_squared.statistic == pytest.approx(0.5)
    assert json.loads(json.dumps(as_json(found), allow_nan=False))["rescues"] == [5, 3]


def test_equivalence_over_runs_is_two_t_tests() -> None:
    rng = np.random.default_rng(5)
    for share in (0.45, 0.5, 0.6):
        found = runs_of(rng, 5, share, 0.04)
        shares = [run.share.mean for run in found.runs if run.share]
        p = max(
            ttest_1samp(shares, 0.4, alternative="greater").pvalue,
            ttest_1samp(shares, 0.6, alternative="less").pvalue,
        )
        assert found.equivalence_p == pytest.approx(p)
        assert (found.verdict == "even") == (p < 0.05)
        ends = ttest_1samp(shares, 0.5).confidence_interval(0.9)
        assert found.interval_90 == pytest.approx((ends.low, ends.high))


def test_pooled_share_against_a_plain_loop() -> None:
    rng = np.random.default_rng(6)
    runs = [counts(rng, share, episodes=n) for share, n in ((0.3, 30), (0.5, 60), (0.6, 45))]
    found = evenness_of_runs(runs, seed=1).pooled_share
    assert found is not None
    shares = []
    for _ in range(4000):
        first = total = 0
        for run in rng.integers(0, 3, 3):
            drawn = runs[run][rng.integers(0, len(runs[run]), len(runs[run]))]
            first, total = first + drawn[:, 0].sum(), total + drawn.sum()
        shares.append(first / total)
    low, high = np.percentile(shares, (2.5, 97.5))
    assert found.low == pytest.approx(low, abs=0.05 * (high - low))
    assert found.high == pytest.approx(high, abs=0.05 * (high - low))


@pytest.mark.long
def test_pooled_share_of_many_runs_misses_as_often_as_it_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("innerattn.measures.sharing.evenness.RESAMPLES", 500)
    rng, draws = np.random.default_rng(9), 300
    found = [runs_of(rng, 30, 0.5, 0.05).pooled_share for _ in range(draws)]
    missed = np.mean([x is None or not x.low <= 0.5 <= x.high for x in found])
    assert within(missed, 0.05, draws)


def test_runs_that_tell_nothing() -> None:
    none = evenness_of_runs([[[0, 0]], [[0, 0]]], seed=0)
    assert none.verdict == "undecided"
    assert none.share is none.pooled_share is none.chi_squared is none.equivalence_p is None
    alike = evenness_of_runs([[[1, 1]], [[1, 1]]], seed=0)
    assert (alike.share, alike.verdict) == (None, "undecided")
    with pytest.raises(ValueError, match="at least 2"):
        evenness_of_runs([[[1, 1]]], seed=0)


def test_verdict_over_runs_is_false_as_rarely_as_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("innerattn.measures.sharing.evenness.RESAMPLES", 2)
    rng, draws = np.random.default_rng(8), 400
    found = [runs_of(rng, 4, 0.6, 0.05) for _ in range(draws)]
    assert within(np.mean([x.verdict == "even" for x in found]), 0.05, draws)
    missed = np.mean([x.share is None or not x.share.low <= 0.6 <= x.share.high for x in found])
    assert within(missed, 0.05, draws)


def test_counts_by_episode_are_those_of_cooperation() -> None:
    scenario = Scenario.preset("double")
    record = run_episodes(scripted_policy("hungarian", scenario), scenario, 20, 4, first_episode=7)
    by_episode = counts_by_episode(record)
    whole = count_cooperation(record.rescues, scenario)
    assert by_episode.keys() == whole.keys()
    for task, table in by_episode.items():
        assert table.shape == (20, 2)
        assert table.sum(0).tolist() == list(whole[task].values())
        for e, row in enumerate(table):
            own = record.rescues[record.rescues["episode"] == 7 + e]
            assert row.tolist() == list(count_cooperation(own, scenario)[task].values())
