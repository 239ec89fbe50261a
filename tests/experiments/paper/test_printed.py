"""Table II as printed, worked out again."""

import pytest
from scipy.stats import chisquare

from innerattn.experiments.paper.printed import (
    COMMON_RESCUES,
    TABLE_II,
    checked_table,
    chi_squared_of,
    implied_rescues,
)


def test_a_row_is_what_the_paper_prints() -> None:
    assert len(TABLE_II) == 8
    assert all(sum(row.shares) == pytest.approx(1.0) for row in TABLE_II)
    printed = [(row.shares[0], row.chi_squared) for row in TABLE_II]
    assert printed == [
        (0.47, 0.36), (0.82, 81.9), (0.56, 1.44), (0.18, 81.9),
        (0.48, 0.16), (0.32, 25.9), (0.45, 1.00), (0.73, 42.3),
    ]  # fmt: skip


@pytest.mark.parametrize("rescues", [100, 200])
def test_chi_squared_is_that_of_counts(rescues: int) -> None:
    for row in TABLE_II:
        counts = [round(share * rescues) for share in row.shares]
        assert chi_squared_of(row.shares[0], rescues) == pytest.approx(chisquare(counts).statistic)


def test_printed_values_need_two_numbers_of_rescues() -> None:
    for row in TABLE_II:
        n = 100 if row.method.endswith("inner") else 200
        fewest, most = implied_rescues(row)
        assert round(chi_squared_of(row.shares[0], n), row.decimals) == pytest.approx(
            row.chi_squared, abs=0.1 if n == 200 else 1e-9
        )
        assert fewest < n < most
    attentive = [implied_rescues(row) for row in TABLE_II if row.method.endswith("inner")]
    baseline = [implied_rescues(row) for row in TABLE_II if row.method.endswith("uniform")]
    # No rounding makes them one number.
    assert max(most for _, most in attentive) < min(fewest for fewest, _ in baseline)


def test_at_one_number_the_verdicts_stand() -> None:
    rows = checked_table()
    assert COMMON_RESCUES == 100
    assert [round(row.chi_squared, 2) for row in rows] == [
        0.36, 40.96, 1.44, 40.96, 0.16, 12.96, 1.0, 21.16,
    ]  # fmt: skip
    assert [row.rejected for row in rows] == [False, True] * 4
    assert [row.consistent for row in rows] == [True, False] * 4
    assert [row.text_shares for row in rows] == [(0.52, 0.48), (0.9, 0.1)] + [None] * 6
