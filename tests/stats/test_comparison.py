"""Comparison of methods over seeds against scipy, statsmodels and simulation."""

import numpy as np
import pytest
from scipy.stats import nct, ttest_1samp
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.weightstats import ttost_paired

from innerattn.stats.comparison import contrast, holm


@pytest.mark.parametrize("count", [1, 2, 12])
def test_adjusted_p_values_against_statsmodels(count: int) -> None:
    p_values = np.random.default_rng(count).uniform(size=count).round(1) / 2.0  # ties
    expected = multipletests(p_values, method="holm")[1]
    assert holm(p_values.tolist()) == pytest.approx(expected.tolist())
    assert holm([]) == []


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


@pytest.mark.parametrize("margin", [0.0, -1.0, np.inf, np.nan])
def test_a_margin_is_needed(margin: float) -> None:
    with pytest.raises(ValueError, match="margin = "):
        contrast([[1.0, 2.0]] * 3, [1.0, -1.0], margin)


def test_verdicts_are_false_as_rarely_as_they_say() -> None:
    rng, draws = np.random.default_rng(9), 1000
    apart = [
        contrast(rng.normal(0.0, 3.0, (6, 1)) + rng.normal([1.6, 0.0], 1.0, (6, 2)), (1, -1), 1.6)
        for _ in range(draws)
    ]
    found = [one for one in apart if one is not None]
    assert len(found) == draws
    g = 1.6 / np.sqrt(2.0)
    rates = {
        "equivalent": np.mean([one.equivalent for one in found]),
        "interval": np.mean(
            [not one.difference.low <= 1.6 <= one.difference.high for one in found]
        ),
        "effect size": np.mean([not one.hedges_g.low <= g <= one.hedges_g.high for one in found]),
    }
    for name, rate in rates.items():
        assert rate == pytest.approx(0.05, abs=3 * np.sqrt(0.05 * 0.95 / draws)), name


def test_what_differs_by_rounding_alone_does_not_differ() -> None:
    assert contrast([[0.1, 0.2], [0.2, 0.3], [0.3, 0.4]], [1.0, -1.0], 0.05) is None


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
