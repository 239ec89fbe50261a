"""Comparison of two groups of runs against scipy, statsmodels and simulation."""

import json
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import nct, permutation_test, ttest_ind
from scipy.stats import t as t_distribution
from statsmodels.regression.linear_model import OLS
from statsmodels.stats.meta_analysis import effectsize_smd
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.weightstats import ttost_ind

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


def several(seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.normal(mean, 1.0 + mean, 5 + i) for i, mean in enumerate((0.1, 0.5, 0.0, 9.0))]


@pytest.mark.parametrize("seed", range(3))
def test_contrast_of_several_groups(seed: int) -> None:
    x = several(seed)
    found = contrast(x, WEIGHTS, 1.0)
    assert found is not None
    # Satterthwaite's formula, and the noncentral t of a regression on indicators of the groups.
    parts = [w**2 * np.var(v, ddof=1) / len(v) for v, w in zip(x, WEIGHTS, strict=True)]
    dof = sum(parts) ** 2 / sum(p**2 / (len(v) - 1) for p, v in zip(parts, x, strict=True))
    difference = x[0].mean() / 2 + x[1].mean() / 2 - x[2].mean()
    half = t_distribution.ppf(0.975, dof) * np.sqrt(sum(parts))
    assert found.dof == pytest.approx(dof)
    assert found.difference.low == pytest.approx(difference - half)
    assert found.difference.high == pytest.approx(difference + half)
    within = [
        t_distribution.cdf((side * difference - 1.0) / np.sqrt(sum(parts)), dof) for side in (1, -1)
    ]
    assert found.equivalence_p == pytest.approx(max(within))
    counted = x[:3]
    indicators = np.repeat(np.eye(3), [len(v) for v in counted], axis=0)
    pooled = OLS(np.concatenate(counted), indicators).fit().t_test(np.array(WEIGHTS[:3]))
    scale = np.sqrt(sum(w**2 / len(v) for v, w in zip(counted, WEIGHTS, strict=False)))
    g = found.hedges_g
    assert nct.cdf(pooled.tvalue, pooled.df_denom, g.low / scale) == pytest.approx(0.975, abs=1e-6)
    assert nct.cdf(pooled.tvalue, pooled.df_denom, g.high / scale) == pytest.approx(0.025, abs=1e-6)
    assert g.mean == pytest.approx(
        float(pooled.tvalue.item()) * scale * (1 - 3 / (4 * pooled.df_denom - 1)), rel=1e-3
    )


def test_a_contrast_of_two_is_a_comparison() -> None:
    x, y = groups(2)
    assert vars(contrast([x, y], [1.0, -1.0], 0.5)).items() <= vars(found_of(x, y, 0.5)).items()


@pytest.mark.parametrize("weights", [(1.0, -0.5, 0.0, 0.0), (1.0, -1.0), ()])
def test_weights_that_compare_nothing_are_refused(weights: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="weights = "):
        contrast(several(0), weights, 1.0)


def test_a_group_of_one_is_refused_by_its_place() -> None:
    with pytest.raises(ValueError, match=r"groups\[1\] = "):
        contrast([[1.0, 2.0], [3.0]], [1.0, -1.0], 1.0)


def test_contrasts_are_false_as_rarely_as_they_say() -> None:
    rng, draws = np.random.default_rng(4), 1000
    weights = (1 / 3, 1 / 3, 1 / 3, -1.0)
    found = [
        contrast([rng.normal(0.0, s, 6) for s in (1.0, 1.0, 2.0, 2.0)], weights, 1.0)
        for _ in range(draws)
    ]
    rate = np.mean([one is None or one.p < 0.05 for one in found])
    assert rate == pytest.approx(0.05, abs=3 * np.sqrt(0.05 * 0.95 / draws))


def test_document() -> None:
    document = found_of(*groups(0)).to_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert set(document["difference"]) == {"mean", "low", "high"}


def test_nothing_to_judge_by() -> None:
    assert compare([1.0, 1.0], [2.0, 2.0], 0.5, 0) is None
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
