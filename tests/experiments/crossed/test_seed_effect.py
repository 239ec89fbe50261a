"""How alike runs of one seed are: against a published example, a simulation and plain sums."""

import numpy as np
import pytest

from innerattn.experiments.crossed.arms import ARMS, Arm
from innerattn.experiments.crossed.outcome import Outcome
from innerattn.experiments.crossed.seed_effect import intraclass_correlation, seed_effects

# Shrout & Fleiss 1979, table 2: six targets, four judges; ICC(3,1) is .71 (table 4).
JUDGES = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]


def plain(rows: list[list[float]]) -> float:
    n, k = len(rows), len(rows[0])
    mean = sum(map(sum, rows)) / (n * k)
    by_row = [sum(row) / k for row in rows]
    by_column = [sum(row[j] for row in rows) / n for j in range(k)]
    between = k * sum((m - mean) ** 2 for m in by_row) / (n - 1)
    left = sum(
        (rows[i][j] - by_row[i] - by_column[j] + mean) ** 2 for i in range(n) for j in range(k)
    )
    error = left / ((n - 1) * (k - 1))
    return (between - error) / (between + (k - 1) * error)


def test_the_published_example() -> None:
    found = intraclass_correlation(JUDGES)
    assert found is not None
    assert found.mean == pytest.approx(0.71, abs=0.005)
    assert (found.low, found.high) == pytest.approx((0.34, 0.95), abs=0.005)


@pytest.mark.parametrize("seed", range(3))
def test_against_plain_sums(seed: int) -> None:
    rows = np.random.default_rng(seed).normal(size=(7, 3)).tolist()
    found = intraclass_correlation(rows)
    assert found is not None
    assert found.mean == pytest.approx(plain(rows))
    moved = np.array(rows) + np.array([5.0, 0.0, -2.0])  # an arm's mean says nothing about seeds
    again = intraclass_correlation(moved)
    assert again is not None
    assert (again.mean, again.low) == pytest.approx((found.mean, found.low))


def test_the_interval_holds_what_it_says() -> None:
    rng = np.random.default_rng(0)
    true, held = 0.6, 0
    for _ in range(400):
        seeds = rng.normal(size=(10, 1)) * np.sqrt(true)
        rows = seeds + rng.normal(size=(10, 4)) * np.sqrt(1.0 - true)
        found = intraclass_correlation(rows)
        assert found is not None
        held += found.low < true < found.high
    assert 0.92 < held / 400 < 0.98


def test_runs_that_differ_by_their_arm_only_have_none() -> None:
    assert intraclass_correlation([[1.0, 2.0], [3.0, 4.0], [0.0, 1.0]]) is None
    for values in ([[1.0, 2.0]], [[1.0], [2.0]], [1.0, 2.0]):
        with pytest.raises(ValueError, match="must be"):
            intraclass_correlation(values)


def test_each_credit_has_its_own() -> None:
    rng = np.random.default_rng(1)
    roles = rng.normal(0.0, 0.1, 10)  # of a seed, under team credit, whatever the attention
    outcomes: dict[Arm, dict[int, Outcome]] = {}
    for arm in ARMS:
        seeds = range(9 if arm == Arm("team", 0.0) else 10)
        share = {
            seed: 0.5 + rng.normal(0.0, 0.01) + (roles[seed] if arm.credit == "team" else 0.0)
            for seed in seeds
        }
        outcomes[arm] = {
            seed: Outcome(0.0, 0.5, 2.0, 0.7, 0.9, 0.99 if arm.shared else share[seed])
            for seed in seeds
        }
    helpers, team = seed_effects(outcomes)
    assert (helpers.credit, helpers.arms, helpers.seeds) == ("helpers", 4, 10)
    assert (team.credit, team.arms, team.seeds) == ("team", 4, 9)  # one seed lacks an arm
    assert team.correlation is not None
    assert team.correlation.low > 0.9
    assert helpers.correlation is not None
    assert helpers.correlation.low < 0.1
    assert team.most is not None
    assert team.most < 0.99  # the arm with shared parameters is another question
    few = seed_effects({arm: {0: run[0], 1: run[1]} for arm, run in outcomes.items()})
    assert [(one.seeds, one.correlation) for one in few] == [(2, None), (2, None)]
    assert [(one.seeds, one.least) for one in seed_effects({})] == [(0, None), (0, None)]
