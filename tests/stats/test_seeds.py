"""Means and bands over few runs, against plain loops."""

import math

import numpy as np
import pytest

from innerattn.stats import Estimate
from innerattn.stats.estimate import as_json
from innerattn.stats.seeds import seed_curve, seed_estimate
from innerattn.stats.student import student_interval


def test_a_mean_says_how_many_runs_have_it() -> None:
    found = seed_estimate([1.0, None, 2.0, 4.0, math.nan])
    interval = student_interval([1.0, 2.0, 4.0])
    assert found is not None
    assert (found.mean, found.low, found.high, found.runs) == (
        *(interval.mean, interval.low, interval.high, 3),
    )
    alone = seed_estimate([None, 2.0])
    assert alone is not None
    assert alone == Estimate(2.0, runs=1)
    assert seed_estimate([None, math.nan]) is None


def test_bands_against_plain_loops() -> None:
    values = np.random.default_rng(0).normal(size=(4, 5))
    values[0, 1], values[:2, 2], values[1:, 3], values[:, 4] = (np.nan,) * 4
    found = seed_curve(values)
    assert found.band == "student"
    assert found.runs.tolist() == [4, 3, 2, 1, 0]
    for t, count in enumerate(found.runs):
        own = [value for value in values[:, t] if not math.isnan(value)]
        seen = (found.mean[t], found.low[t], found.high[t])
        if count > 2:
            interval = student_interval(own)
            assert seen == pytest.approx((interval.mean, interval.low, interval.high))
        elif count == 2:
            assert seen == pytest.approx((sum(own) / 2, min(own), max(own)))
        else:
            assert np.isnan(seen[1:]).all()
    assert as_json(found)["mean"][4] is None


@pytest.mark.parametrize(("runs", "kind"), [(1, "none"), (2, "range"), (3, "student")])
def test_the_kind_of_band_follows_the_number_of_runs(runs: int, kind: str) -> None:
    assert seed_curve(np.zeros((runs, 2))).band == kind


def test_numbers_for_json() -> None:
    assert as_json(np.array([[1.0, np.nan]])) == [[1.0, None]]
