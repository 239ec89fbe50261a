"""Unevenness beside the score, against a regression with a mean for each method."""

from __future__ import annotations

import numpy as np
import pytest
import statsmodels.api as sm

from innerattn.experiments.paper.competence import COMPETENCE, Competence
from innerattn.experiments.paper.imbalance_score import imbalance_score_correlations
from innerattn.stats.seeds import seed_estimate


def made(method: str, imbalance: list[float], scores: list[float | None]) -> Competence:
    nothing: dict[str, float | None] = dict.fromkeys(COMPETENCE)
    each = tuple(
        nothing | {"imbalance": one, "score": other}
        for one, other in zip(imbalance, scores, strict=True)
    )
    mean = {name: seed_estimate([figures[name] for figures in each]) for name in COMPETENCE}
    return Competence("double", method, tuple(range(len(each))), (), each, mean)


def test_correlation_is_that_of_a_regression_with_a_mean_for_each_method() -> None:
    rng = np.random.default_rng(0)
    groups = [(rng.random(n), rng.random(n) + shift) for n, shift in ((5, 0.0), (4, 3.0), (6, 9.0))]
    parts = [
        made(name, list(x), list(y))
        for name, (x, y) in zip(("td-inner", "td-uniform", "ppo-inner"), groups, strict=True)
    ]
    (found,) = imbalance_score_correlations([*parts, made("hungarian", [0.01, 0.03], [1.0, 1.0])])
    dummies = np.repeat(np.eye(3), [5, 4, 6], axis=0)
    x, y = np.concatenate([g[0] for g in groups]), np.concatenate([g[1] for g in groups])
    fitted = sm.OLS(y, np.column_stack([x, dummies])).fit()
    assert found.p == pytest.approx(fitted.pvalues[0])
    assert np.sign(found.correlation or 0.0) == np.sign(fitted.params[0])
    left = [np.asarray(sm.OLS(one, dummies).fit().resid) for one in (x, y)]
    assert found.correlation == pytest.approx(np.corrcoef(*left)[0, 1])
    assert (found.situation, found.runs) == ("double", 15)
    assert found.script == pytest.approx((0.02, 1.0))


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


def test_even_runs_that_score_less_are_seen_as_such() -> None:
    (found,) = imbalance_score_correlations(
        [made("td-inner", [0.0, 0.1, 0.2, 0.3], [0.6, 0.7, 0.8, 0.91])]
    )
    assert found.correlation is not None
    assert found.correlation > 0.99
    assert found.p is not None
    assert found.p < 0.01
