"""Learnt attention beside uniform weights, against plain computations."""

import numpy as np
import pytest
from scipy.stats import trim_mean, ttest_rel

from innerattn.experiments.paper.competence import Competence, competence_units
from innerattn.experiments.paper.pairs import pairs, together


def made(situation: str, method: str, scores: dict[int, float | None]) -> Competence:
    nothing: dict[str, float | None] = dict.fromkeys(competence_units())
    each = tuple(nothing | {"score": score, "imbalance": 0.1} for score in scores.values())
    return Competence(situation, method, tuple(scores), (), each, {})


INNER = {0: 0.9, 1: 0.8, 2: 0.7, 4: 0.95}
UNIFORM = {4: 0.9, 2: 0.6, 1: 0.85, 3: 0.1}


def test_seeds_are_compared_pairwise() -> None:
    found = pairs([made("mixed", "td-inner", {**INNER}), made("mixed", "td-uniform", {**UNIFORM})])
    score, imbalance = found
    assert (score.measure, score.seeds) == ("score", (1, 2, 4))
    ours, theirs = [0.8, 0.7, 0.95], [0.85, 0.6, 0.9]
    assert score.inner is not None
    assert score.uniform is not None
    assert (score.inner.mean, score.uniform.mean) == pytest.approx((np.mean(ours), np.mean(theirs)))
    assert score.contrast is not None
    expected = ttest_rel(ours, theirs)
    assert score.contrast.p == pytest.approx(expected.pvalue)
    ends = expected.confidence_interval()
    assert score.contrast.difference.low == pytest.approx(ends.low)
    assert imbalance.contrast is None  # all differences are the same


def test_what_has_no_counterpart_or_too_few_seeds_is_not_compared() -> None:
    assert (
        pairs([made("mixed", "td-inner", {0: 0.5}), made("single", "td-uniform", {0: 0.5})]) == []
    )
    two = [
        made("mixed", f"ppo-{kind}", {0: 0.5, 1: score})
        for kind, score in (("inner", 0.6), ("uniform", None))
    ]
    score, imbalance = pairs(two)
    assert (score.seeds, score.contrast) == ((0,), None)
    assert (imbalance.seeds, imbalance.contrast) == ((0, 1), None)
    assert together(two) == []  # a single run of one has a score


def test_situations_together() -> None:
    parts = [
        made(situation, f"td-{kind}", {**values})
        for situation in ("single", "mixed")
        for kind, values in (("inner", INNER), ("uniform", UNIFORM))
    ]
    (found,) = together([*parts, made("mixed", "hungarian", {0: 1.0, 1: 1.0})])
    assert (found.algorithm, found.situations) == ("td", ("single", "mixed"))
    twice = [*INNER.values()] * 2
    assert found.inner.mean == pytest.approx(trim_mean(twice, 0.25))
    wins = np.mean([a > b for a in INNER.values() for b in UNIFORM.values()])
    ties = np.mean([a == b for a in INNER.values() for b in UNIFORM.values()])
    assert found.better.mean == pytest.approx(wins + ties / 2)
    assert found.better.low < found.better.mean < found.better.high
