"""Imbalance beside the score: a regression, every exchange of seeds, and false positives."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.stats import pearsonr

from innerattn.experiments.paper.competence import Competence, competence_units
from innerattn.experiments.paper.imbalance_score import (
    correlation_over_seeds,
    imbalance_score_correlations,
)
from innerattn.stats.seeds import seed_estimate


def made(method: str, imbalance: list[float], scores: list[float | None]) -> Competence:
    nothing: dict[str, float | None] = dict.fromkeys(competence_units())
    each = tuple(
        nothing | {"imbalance": one, "score": other}
        for one, other in zip(imbalance, scores, strict=True)
    )
    mean = {name: seed_estimate([values[name] for values in each]) for name in competence_units()}
    return Competence("double", method, tuple(range(len(each))), (), each, mean)


def test_correlation_is_that_of_a_regression_with_a_mean_for_each_method() -> None:
    rng = np.random.default_rng(0)
    groups = [(rng.random(n), rng.random(n) + shift) for n, shift in ((5, 0.0), (4, 3.0), (6, 9.0))]
    parts = [
        made(name, list(x), list(y))
        for name, (x, y) in zip(("td-inner", "td-uniform", "ppo-inner"), groups, strict=True)
    ]
    (found,) = imbalance_score_correlations([*parts, made("hungarian", [0.01, 0.03], [1.0, 1.0])])
    dummies = np.repeat(np.eye(3), 4, axis=0)  # seeds 0 to 3 are those that all methods have
    x, y = (np.concatenate([group[i][:4] for group in groups]) for i in (0, 1))
    left = [np.asarray(sm.OLS(one, dummies).fit().resid) for one in (x, y)]
    assert found.correlation == pytest.approx(np.corrcoef(*left)[0, 1])
    assert (found.situation, found.runs) == ("double", 12)
    assert found.script == pytest.approx((0.02, 1.0))


@pytest.mark.parametrize("seeds", [3, 5])
def test_p_is_the_share_of_all_exchanges_of_whole_seeds(seeds: int) -> None:
    x, y = np.random.default_rng(seeds).normal(size=(2, 4, seeds))
    centred = x - x.mean(1, keepdims=True)
    every = [
        sum(centred[m, s] * y[m, order[s]] for m in range(4) for s in range(seeds))
        for order in permutations(range(seeds))
    ]
    _, p = correlation_over_seeds(x, y)
    assert p == pytest.approx(np.mean(np.abs(every) >= abs(every[0]) - 1e-12))


def test_p_of_many_seeds_is_about_that_of_one_method() -> None:
    x, y = np.random.default_rng(1).normal(size=(2, 1, 12))
    y += 0.6 * x
    correlation, p = correlation_over_seeds(x, y)
    expected = pearsonr(x[0], y[0])
    assert correlation == pytest.approx(expected.statistic)
    assert p == pytest.approx(expected.pvalue, abs=0.01)
    assert 0.01 < expected.pvalue < 0.3


def test_seed_effects_do_not_make_false_positives() -> None:
    rng, draws = np.random.default_rng(2), 600
    rejected = {"blocks": 0, "independent runs": 0}
    for _ in range(draws):
        # What the runs of a seed have in common, in each of both values, and what is their own.
        x, y = rng.normal(size=(2, 1, 5)) + 0.5 * rng.normal(size=(2, 4, 5))
        _, p = correlation_over_seeds(x, y)
        assert p is not None
        rejected["blocks"] += p <= 0.05
        centred = [(values - values.mean(1, keepdims=True)).ravel() for values in (x, y)]
        rejected["independent runs"] += pearsonr(*centred).pvalue <= 0.05
    assert rejected["blocks"] / draws == pytest.approx(0.05, abs=3 * np.sqrt(0.05 * 0.95 / draws))
    assert rejected["independent runs"] / draws > 0.2


def test_what_cannot_be_judged_has_no_correlation() -> None:
    (few,) = imbalance_score_correlations([made("td-inner", [0.1, 0.2], [0.5, 0.6])])
    assert (few.runs, few.correlation, few.p, few.script) == (2, None, None, (None, None))
    (alike,) = imbalance_score_correlations(
        [made("td-inner", [0.1] * 5, [0.5, 0.6, 0.7, 0.8, 0.9])]
    )
    assert (alike.runs, alike.correlation) == (5, None)
    (missing,) = imbalance_score_correlations(
        [made("td-inner", [0.1, 0.2, 0.3, 0.4], [0.5, None, 0.7, 0.8])]
    )
    assert (missing.runs, missing.correlation) == (3, pytest.approx(1.0))
    assert imbalance_score_correlations([made("hungarian", [0.1, 0.2], [1.0, 1.0])]) == []


def test_even_runs_that_score_less() -> None:
    (found,) = imbalance_score_correlations(
        [made("td-inner", [0.0, 0.1, 0.2, 0.3], [0.6, 0.7, 0.8, 0.91])]
    )
    assert found.correlation is not None
    assert found.correlation > 0.99
    assert found.p == pytest.approx(2 / 24)  # as far only if it is turned round
