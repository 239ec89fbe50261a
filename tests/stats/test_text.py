"""Numbers as they stand in tables and sentences."""

import pytest

from innerattn.stats import Estimate
from innerattn.stats.text import (
    NONE,
    format_estimate,
    format_number,
    format_p,
    format_seeds,
    format_signed,
)


def test_no_number_is_minus_zero() -> None:
    assert [format_number(x) for x in (-0.004, -0.006, 2.0)] == ["0.00", "-0.01", "2.00"]
    assert [format_signed(x) for x in (-0.004, -0.006, 0.01)] == ["+0.00", "-0.01", "+0.01"]
    assert (format_number(0.125, 1), format_signed(0.125, 1)) == ("0.1", "+0.1")


def test_an_estimate_shows_its_interval_where_it_has_one() -> None:
    assert format_estimate(Estimate(0.5, 0.25, 0.75)) == "0.50 [0.25, 0.75]"
    assert format_estimate(Estimate(0.5, runs=1), 1) == "0.5"
    assert format_estimate(None) == format_p(None) == NONE


def test_small_p_values_are_bounded() -> None:
    assert [format_p(p) for p in (0.0009, 0.001, 0.0495)] == ["< 0.001", "0.001", "0.050"]


@pytest.mark.parametrize(
    ("seeds", "shown"),
    [([0, 1, 2], "0 to 2"), ([4, 3, 5, 6], "3 to 6"), ([0, 1], "0, 1"), ([0, 2, 3], "0, 2, 3")],
)
def test_a_whole_range_of_seeds_is_named_by_its_ends(seeds: list[int], shown: str) -> None:
    assert format_seeds(seeds) == shown
