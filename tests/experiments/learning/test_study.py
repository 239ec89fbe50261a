"""What is said of learning, against the summaries of the runs and plain arithmetic."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from innerattn.errors import RunError
from innerattn.experiments.learning.study import read_learning
from innerattn.experiments.learning.variants import ENTITIES, WARM_START, Variant
from innerattn.experiments.plan import plan
from innerattn.experiments.run import FinishedRun

METHODS = ("td-inner", "td-uniform", "ppo-inner")
SEEDS = (0, 1, 2)


def scored(method: str, seed: int, score: float | None, run: FinishedRun) -> FinishedRun:
    """A run of another method and seed, with other results."""
    (one,) = plan((method,), ("mixed",), (seed,), "short", Path("study"))
    part = {"rescues_per_episode": {"mean": 10.0 * (score or 0.0)}}
    known = None if score is None else {"mean": score}
    long = {**run.summary["long"], **part, "score": None if score is None else {"mean": -score}}
    summary = {**run.summary, **part, "score": known, "long": long}
    return replace(run, case=one.case, config=one.config, summary=summary, archived=True)


def made(run: FinishedRun, **scores: list[float | None]) -> list[FinishedRun]:
    return [
        scored(method.replace("_", "-"), seed, score, run)
        for method, own in scores.items()
        for seed, score in enumerate(own)
    ]


def test_means_and_values_of_each_seed(runs: list[FinishedRun]) -> None:
    found = read_learning(made(runs[0], ppo_inner=[0.5, 0.8, 0.6], td_inner=[0.7]))
    first, second = found.learnt
    assert (first.trained, first.situation, first.seeds) == ("ppo-inner", "mixed", SEEDS)
    assert first.score.each == (0.5, 0.8, 0.6)
    assert first.rescues.each == pytest.approx((5.0, 8.0, 6.0))
    assert first.long_score.each == (-0.5, -0.8, -0.6)
    interval = stats.ttest_1samp([0.5, 0.8, 0.6], 0.0).confidence_interval()
    mean = first.score.mean
    assert mean is not None
    assert (mean.low, mean.high) == pytest.approx((interval.low, interval.high))
    assert mean.runs == 3
    assert second.score.mean is not None
    assert not second.score.mean.bounded
    assert found.differences == found.curves == ()


def test_attention_is_compared_seed_by_seed(runs: list[FinishedRun]) -> None:
    rng = np.random.default_rng(0)
    inner, uniform = rng.random((2, 4)).tolist()
    both = made(runs[0], td_inner=inner, td_uniform=uniform[:3], ppo_inner=inner)
    (found,) = read_learning(both).differences
    assert (found.algorithm, found.situation, found.seeds) == ("td", "mixed", SEEDS)
    expected = stats.ttest_rel(inner[:3], uniform[:3])
    assert found.score is not None
    assert found.score.p == pytest.approx(expected.pvalue)
    assert found.long_score is not None
    assert found.long_score.difference.mean == pytest.approx(-found.score.difference.mean)


def test_what_has_no_score_is_left_out(runs: list[FinishedRun]) -> None:
    both = made(runs[0], td_inner=[0.5, None, 0.7], td_uniform=[0.4, 0.5, 0.2])
    found = read_learning(both)
    assert found.learnt[0].score.each == (0.5, None, 0.7)
    assert found.learnt[0].score.mean is not None
    assert found.learnt[0].score.mean.mean == pytest.approx(0.6)
    assert found.differences[0].score is None


def test_runs_that_cannot_be_compared_are_refused(runs: list[FinishedRun]) -> None:
    one, other = made(runs[0], td_inner=[0.5, 0.6])
    changed = other.config.model_copy(update={"td": other.config.td.replace(polyak=0.5)})
    with pytest.raises(RunError, match="differ in td"):
        read_learning([one, replace(other, config=changed)])


@pytest.mark.parametrize(
    ("variant", "key"), [(ENTITIES, ("network", "encoder")), (WARM_START, ("train", "warm_start"))]
)
def test_a_variant_changes_one_key_of_every_run(variant: Variant, key: tuple[str, str]) -> None:
    asked = (METHODS, ("mixed", "double"), SEEDS, "quick", Path("study"))
    small = {"train.env_steps": 96}
    changed = variant.plan(*asked, small)
    for one, plain in zip(changed, plan(*asked, small), strict=True):
        assert one.case == replace(plain.case, variant=one.case.variant)
        assert one.case.variant in one.folder.name
        assert one.config.train.env_steps == 96
        section, name = key
        assert getattr(getattr(plain.config, section), name) in ("flat", "none")
        assert getattr(getattr(one.config, section), name) in ("entities", "hungarian")
