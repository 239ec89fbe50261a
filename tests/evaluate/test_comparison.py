"""Comparison of two groups of runs against scipy, statsmodels and simulation."""

import json
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import nct, permutation_test, ttest_1samp, ttest_ind
from statsmodels.stats.meta_analysis import effectsize_smd
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.weightstats import ttost_ind, ttost_paired

from innerattn.evaluate import comparison
from innerattn.evaluate.comparison import Comparison, compare, contrast, holm


def groups(seed: int, n: int = 5, m: int = 7) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(1.0, 1.0, n), rng.normal(0.4, 2.0, m)


def found_of(x: np.ndarray, y: np.ndarray, margin: float = 1.0) -> Comparison:
    found = compare(x, y, margin, seed=0)
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(4))
def test_welch_against_scipy(seed: int) -> None:
    x, y = groups(seed)
    found, expected = found_of(x, y), ttest_ind(x, y, equal_var=False)
    ends = expected.confidence_interval()
    assert found.p == pytest.approx(expected.pvalue)
    assert found.dof == pytest.approx(expected.df)
    assert found.difference.mean == pytest.approx(x.mean() - y.mean())
    assert (found.difference.low, found.difference.high) == pytest.approx((ends.low, ends.high))


@pytest.mark.parametrize("margin", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_equivalence_against_statsmodels(seed: int, margin: float) -> None:
    x, y = groups(seed)
    found = found_of(x, y, margin)
    p, _, _ = ttost_ind(x, y, -margin, margin, usevar="unequal")
    assert found.equivalence_p == pytest.approx(p)
    ends = ttest_ind(x, y, equal_var=False).confidence_interval(0.9)
    assert found.equivalent == (-margin < ends.low and ends.high < margin) == (p < 0.05)


@pytest.mark.parametrize("count", [1, 2, 12])
def test_adjusted_p_values_against_statsmodels(count: int) -> None:
    p_values = np.random.default_rng(count).uniform(size=count).round(1) / 2.0  # ties
    expected = multipletests(p_values, method="holm")[1]
    assert holm(p_values.tolist()) == pytest.approx(expected.tolist())
    assert holm([]) == []


@pytest.mark.parametrize(("n", "m"), [(3, 3), (2, 5), (5, 6)])
def test_permutation_test_against_scipy_and_a_plain_loop(n: int, m: int) -> None:
    x, y = groups(n, n, m)
    x = np.round(x, 1)  # ties

    def t(a: np.ndarray, b: np.ndarray, axis: int = -1) -> np.ndarray:
        error = a.var(axis, ddof=1) / a.shape[axis] + b.var(axis, ddof=1) / b.shape[axis]
        return np.abs(a.mean(axis) - b.mean(axis)) / np.sqrt(error)

    expected = permutation_test((x, y), t, alternative="greater", n_resamples=np.inf)
    assert found_of(x, y).permutation_p == pytest.approx(expected.pvalue)
    together = np.concatenate([x, y])
    larger = []
    for chosen in combinations(range(n + m), n):
        first = np.isin(np.arange(n + m), chosen)
        larger.append(t(together[first], together[~first]) >= t(x, y) * (1 - 1e-12))
    assert found_of(x, y).permutation_p == pytest.approx(np.mean(larger))


def test_apart_as_far_as_can_be() -> None:
    assert found_of(np.array([1.0, 2.0, 3.0]), np.array([7.0, 8.0, 9.0])).permutation_p == 0.1
    # One group without scatter, and divisions of which neither has any.
    assert found_of(np.array([1.0, 1.0]), np.array([2.0, 2.0, 3.0])).permutation_p == 0.1


def test_random_permutations_agree_with_all(monkeypatch: pytest.MonkeyPatch) -> None:
    x, y = groups(5, 6, 6)
    exact = found_of(x, y).permutation_p
    monkeypatch.setattr(comparison, "_EXACT", 1)
    drawn = found_of(x, y)
    assert drawn.permutation_p == pytest.approx(exact, abs=4 * np.sqrt(exact / 9999))
    assert drawn == compare(x, y, 1.0, seed=0) != compare(x, y, 1.0, seed=1)
    far = found_of(np.arange(9.0), 100 + np.arange(9.0))
    assert far.permutation_p == pytest.approx(1e-4, abs=2e-4)
    assert far.permutation_p >= 1e-4  # never 0


def test_effect_size_against_statsmodels_and_the_noncentral_t() -> None:
    x, y = groups(6)
    g = found_of(x, y).hedges_g
    expected, _ = effectsize_smd(
        x.mean(), x.std(ddof=1), len(x), y.mean(), y.std(ddof=1), len(y)
    )  # its correction is the usual approximation 1 - 3 / (4 dof - 1)
    assert g.mean == pytest.approx(expected, rel=1e-3)
    scale = np.sqrt(len(x) * len(y) / (len(x) + len(y)))
    t = ttest_ind(x, y).statistic
    assert nct.cdf(t, 10, g.low * scale) == pytest.approx(0.975, abs=1e-6)
    assert nct.cdf(t, 10, g.high * scale) == pytest.approx(0.025, abs=1e-6)
    mirrored = found_of(y, x).hedges_g
    assert (mirrored.mean, mirrored.low) == pytest.approx((-g.mean, -g.high), abs=1e-6)


WEIGHTS = (0.5, 0.5, -1.0, 0.0)


def rows_of(seed: int, n: int = 6) -> np.ndarray:
    """A row for each seed: what its runs have in common, and what is each run's own."""
    rng = np.random.default_rng(seed)
    return rng.normal(0.0, 3.0, (n, 1)) + rng.normal([0.1, 0.5, 0.0, 9.0], 1.0, (n, 4))


@pytest.mark.parametrize("seed", range(3))
def test_contrast_over_seeds_against_scipy_and_statsmodels(seed: int) -> None:
    rows = rows_of(seed)
    found = contrast(rows, WEIGHTS, 1.0)
    assert found is not None
    sums = np.array([row[0] / 2 + row[1] / 2 - row[2] for row in rows])
    expected = ttest_1samp(sums, 0.0)
    ends = expected.confidence_interval()
    assert (found.dof, found.p) == pytest.approx((expected.df, expected.pvalue))
    assert found.difference.mean == pytest.approx(sums.mean())
    assert (found.difference.low, found.difference.high) == pytest.approx((ends.low, ends.high))
    p, _, _ = ttost_paired(sums, np.zeros_like(sums), -1.0, 1.0)
    assert found.equivalence_p == pytest.approx(p)
    assert found.equivalent == (p < 0.05)
    g, scale = found.hedges_g, np.sqrt(len(rows))
    assert g.mean == pytest.approx(
        sums.mean() / sums.std(ddof=1) * (1 - 3 / (4 * expected.df - 1)), rel=3e-3
    )
    assert nct.cdf(expected.statistic, 5, g.low * scale) == pytest.approx(0.975, abs=1e-6)
    assert nct.cdf(expected.statistic, 5, g.high * scale) == pytest.approx(0.025, abs=1e-6)


@pytest.mark.parametrize("weights", [(1.0, -0.5, 0.0, 0.0), (1.0, -1.0), ()])
def test_weights_that_compare_nothing_are_refused(weights: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="weights = "):
        contrast(rows_of(0), weights, 1.0)


@pytest.mark.parametrize("values", [[[1.0, 2.0], [3.0, 4.0]], [1.0, 2.0, 3.0], [[np.nan, 1.0]] * 3])
def test_rows_that_are_none_or_too_few_are_refused(values: list) -> None:
    with pytest.raises(ValueError, match="values = "):
        contrast(values, [1.0, -1.0], 1.0)


def test_contrasts_are_false_as_rarely_as_they_say_however_alike_runs_of_a_seed_are() -> None:
    rng, draws = np.random.default_rng(4), 1000
    weights, spread = (1 / 3, 1 / 3, 1 / 3, -1.0), [1.0, 1.0, 2.0, 2.0]
    for common in (0.0, 5.0):
        found = [
            contrast(
                rng.normal(0.0, common, (6, 1)) + rng.normal(0.0, spread, (6, 4)), weights, 1.0
            )
            for _ in range(draws)
        ]
        rate = np.mean([one is None or one.p < 0.05 for one in found])
        assert rate == pytest.approx(0.05, abs=3 * np.sqrt(0.05 * 0.95 / draws))


def test_seeds_that_do_not_differ_leave_nothing_to_judge_by() -> None:
    assert contrast([[1.0, 2.0], [2.0, 3.0], [5.0, 6.0]], [1.0, -1.0], 0.5) is None


def test_document() -> None:
    document = found_of(*groups(0)).to_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert set(document["difference"]) == {"mean", "low", "high"}


def test_nothing_to_judge_by() -> None:
    assert compare([1.0, 1.0], [2.0, 2.0], 0.5, 0) is None
    assert compare([0.1] * 3, [0.2] * 3, 0.5, 0) is None  # whose means are rounded
    assert compare([1.0, 1.0], [2.0, 2.1], 0.5, 0) is not None


@pytest.mark.parametrize(("x", "margin"), [([1.0], 1.0), ([1.0, np.nan], 1.0), ([[1.0, 2.0]], 1.0)])
def test_what_is_no_group_is_refused(x: list, margin: float) -> None:
    with pytest.raises(ValueError, match="x = "):
        compare(x, [1.0, 2.0], margin, 0)
    with pytest.raises(ValueError, match="y = "):
        compare([1.0, 2.0], x, margin, 0)


@pytest.mark.parametrize("margin", [0.0, -1.0, np.inf, np.nan])
def test_a_margin_is_needed(margin: float) -> None:
    with pytest.raises(ValueError, match="margin = "):
        compare([1.0, 2.0], [1.0, 3.0], margin, 0)
    with pytest.raises(ValueError, match="margin = "):
        contrast([[1.0, 2.0]] * 3, [1.0, -1.0], margin)


def test_verdicts_are_false_as_rarely_as_they_say() -> None:
    rng, draws = np.random.default_rng(9), 700
    at_margin = [
        found_of(rng.normal(1.6, 1.0, 6), rng.normal(0.0, 1.0, 6), 1.6) for _ in range(draws)
    ]
    alike = [found_of(rng.normal(0.0, 1.0, 6), rng.normal(0.0, 1.0, 6)) for _ in range(draws)]
    rates = {
        "equivalent": np.mean([x.equivalent for x in at_margin]),
        "welch": np.mean([x.p < 0.05 for x in alike]),
        "permutation": np.mean([x.permutation_p <= 0.05 for x in alike]),
        "interval": np.mean([not x.difference.low <= 1.6 <= x.difference.high for x in at_margin]),
        "effect size": np.mean([not x.hedges_g.low <= 1.6 <= x.hedges_g.high for x in at_margin]),
    }
    for name, rate in rates.items():
        assert rate == pytest.approx(0.05, abs=3 * np.sqrt(0.05 * 0.95 / draws)), name


def test_what_differs_by_rounding_alone_does_not_differ() -> None:
    assert contrast([[0.1, 0.2], [0.2, 0.3], [0.3, 0.4]], [1.0, -1.0], 0.05) is None
    assert compare([0.1 + 0.2, 0.3], [0.5, 0.5], 0.5, 0) is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_large_effect_has_an_interval_that_grows_with_it(sign: float) -> None:
    below, above, far = (
        contrast([[sign * x, 0.0] for x in (size - 1.0, size, size + 1.0)], [1.0, -1.0], 0.5)
        for size in (570.0, 580.0, 1e9)  # t is 1e3 between the first two
    )
    assert below is not None
    assert above is not None
    assert far is not None
    for one, size in ((below, 570.0), (far, 1e9)):
        g, known = one.hedges_g, above.hedges_g
        scale = size / 580.0
        assert (g.mean, g.low, g.high) == pytest.approx(
            (scale * known.mean, scale * known.low, scale * known.high), rel=1e-3
        )
    assert above.hedges_g.low < above.hedges_g.mean < above.hedges_g.high
