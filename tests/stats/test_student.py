"""Student's t against printed tables, scipy's tests and simulation."""

import numpy as np
import pytest
from scipy.stats import ttest_1samp
from statsmodels.stats.weightstats import DescrStatsW

from innerattn.stats.student import difference_p, equivalence_p, student_interval


@pytest.mark.parametrize("n", [2, 3, 10])
@pytest.mark.parametrize("level", [0.9, 0.95])
def test_interval_and_tests_against_scipy_and_statsmodels(n: int, level: float) -> None:
    values = np.random.default_rng(n).normal(0.3, 0.4, n)
    expected = ttest_1samp(values, 0.0)
    ends, interval = expected.confidence_interval(level), student_interval(values, level)
    assert interval.mean == pytest.approx(values.mean())
    assert (interval.low, interval.high) == pytest.approx((ends.low, ends.high))
    assert difference_p(values) == pytest.approx(expected.pvalue)
    p, _, _ = DescrStatsW(values).ttost_mean(-0.1, 0.5)
    assert equivalence_p(values, -0.1, 0.5) == pytest.approx(p)


def test_values_that_are_all_the_same_have_an_interval_of_no_length() -> None:
    interval = student_interval([0.25, 0.25, 0.25])
    assert (interval.mean, interval.low, interval.high) == (0.25, 0.25, 0.25)


@pytest.mark.parametrize(("n", "quantile"), [(2, 12.7062), (5, 2.7764), (30, 2.0452)])
def test_interval_over_runs_has_the_quantiles_of_the_tables(n: int, quantile: float) -> None:
    values = np.random.default_rng(n).normal(7.0, 2.0, n)
    interval = student_interval(values)
    deviation = np.sqrt(np.sum((values - values.mean()) ** 2) / (n - 1))
    assert interval.mean == pytest.approx(values.mean())
    assert interval.high - interval.mean == pytest.approx(
        quantile * deviation / np.sqrt(n), rel=1e-4
    )
    assert interval.mean - interval.low == pytest.approx(interval.high - interval.mean)


def test_interval_over_few_runs_holds_the_truth_as_often_as_it_says() -> None:
    samples = np.random.default_rng(0).normal(3.0, 1.0, (4000, 4))
    intervals = [student_interval(sample) for sample in samples]
    assert np.mean([x.low <= 3.0 <= x.high for x in intervals]) == pytest.approx(0.95, abs=0.012)


def test_interval_over_runs_needs_two() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        student_interval([1.0])
