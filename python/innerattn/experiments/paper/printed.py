"""The paper's Table II as printed, and whether its numbers agree with each other."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import chdtrc

COMMON_RESCUES = 100
"""Number of rescues at which all rows are compared; the attentive rows' χ² were made with it."""

_SHARE_ROUNDING = 0.005


@dataclass(frozen=True)
class PrintedRow:
    """One row of Table II.

    Attributes:
        method: the method here that the row's stands for.
        task: name of the task.
        shares: of rescues, by the first and the second food robot, to two decimals.
        chi_squared: as printed.
        decimals: how many of chi_squared are printed.
    """

    method: str
    task: str
    shares: tuple[float, float]
    chi_squared: float
    decimals: int


TABLE_II = (
    PrintedRow("td-inner", "task_1", (0.47, 0.53), 0.36, 2),
    PrintedRow("td-uniform", "task_1", (0.82, 0.18), 81.9, 1),
    PrintedRow("td-inner", "task_2", (0.56, 0.44), 1.44, 2),
    PrintedRow("td-uniform", "task_2", (0.18, 0.82), 81.9, 1),
    PrintedRow("ppo-inner", "task_1", (0.48, 0.52), 0.16, 2),
    PrintedRow("ppo-uniform", "task_1", (0.32, 0.68), 25.9, 1),
    PrintedRow("ppo-inner", "task_2", (0.45, 0.55), 1.00, 2),
    PrintedRow("ppo-uniform", "task_2", (0.73, 0.27), 42.3, 1),
)
"""Table II in its order; its baselines are what is called uniform here."""

TEXT = {
    ("td-inner", "task_1"): (0.52, 0.48),
    ("td-uniform", "task_1"): (0.90, 0.10),
}
"""Shares that section IV states beside the table, by method and task: others than the table's."""


@dataclass(frozen=True)
class CheckedRow:
    """What a printed row says when it is worked out again.

    Attributes:
        row: the row as printed.
        implied_rescues: fewest and most rescues that give the printed χ², by rounding of it and of
            the shares.
        chi_squared: of the printed shares at the common number of rescues.
        rejected: whether evenness is rejected then, at 5 %.
        consistent: whether the common number lies within ``implied_rescues``.
        text_shares: what the text states where it states something else; None elsewhere.
    """

    row: PrintedRow
    implied_rescues: tuple[float, float]
    chi_squared: float
    rejected: bool
    consistent: bool
    text_shares: tuple[float, float] | None


def chi_squared_of(share: float, rescues: float) -> float:
    """χ² of two shares p and 1 - p of n rescues against equal ones: ``4 n (p - 1/2)²``."""
    return 4.0 * rescues * (share - 0.5) ** 2


def implied_rescues(row: PrintedRow) -> tuple[float, float]:
    """Fewest and most rescues with which the row's shares could round to its χ²."""
    apart = abs(row.shares[0] - 0.5)
    rounding = 0.5 * 10.0**-row.decimals
    fewest = (row.chi_squared - rounding) / (4.0 * (apart + _SHARE_ROUNDING) ** 2)
    most = (row.chi_squared + rounding) / (4.0 * (apart - _SHARE_ROUNDING) ** 2)
    return fewest, most


def checked_table() -> tuple[CheckedRow, ...]:
    """Table II worked out again at one common number of rescues."""
    return tuple(map(_checked, TABLE_II))


def _checked(row: PrintedRow) -> CheckedRow:
    fewest, most = implied_rescues(row)
    chi_squared = chi_squared_of(row.shares[0], COMMON_RESCUES)
    return CheckedRow(
        row=row,
        implied_rescues=(fewest, most),
        chi_squared=chi_squared,
        rejected=bool(chdtrc(1, chi_squared) < 0.05),
        consistent=fewest <= COMMON_RESCUES <= most,
        text_shares=TEXT.get((row.method, row.task)),
    )
