"""The recipe with one change each: what is planned, what differs, and what the page says."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markdown_rows import rows_of
from scipy import stats

from innerattn.experiments.learning.ablations import read_ablations
from innerattn.experiments.learning.recipe import ABLATIONS, RECIPE, plan_ablations
from innerattn.experiments.run import FinishedRun
from innerattn.report.learning.ablations import DIFFERENCES, FILES, write_ablations

WORDS = [one.variant.word for one in ABLATIONS]
SLOW, WIDE = WORDS.index("slow"), WORDS.index("wide")


def made(run: FinishedRun, scores: dict[str, list[float | None]]) -> list[FinishedRun]:
    """Runs of some changes in mixed, with other results."""
    found = []
    for one in plan_ablations(("ppo-inner",), ("mixed",), range(4), "fast", Path("study")):
        own = scores.get(one.case.variant, [])
        if one.case.seed < len(own):
            score = own[one.case.seed]
            known = None if score is None else {"mean": score}
            long = {"score": None if score is None else {"mean": -2.0 * score}}
            summary = {**run.summary, "score": known, "long": {**run.summary["long"], **long}}
            found.append(replace(run, case=one.case, config=one.config, summary=summary))
    return found


def test_each_change_is_one_of_the_recipe_and_trains_otherwise() -> None:
    planned = plan_ablations(("ppo-inner",), ("mixed",), (0,), "fast", Path("study"))
    recipe, *changed = [one.config.in_use() for one in planned]
    assert len(set(WORDS)) == len(WORDS) == len(changed) > 10
    for ablation, config in zip(ABLATIONS, changed, strict=True):
        differing = {
            f"{section}.{key}"
            for section, values in config.items()
            for key, value in values.items()
            if value != recipe[section][key]
        }
        named = {".".join(key.split(".")[:2]) for key in ablation.variant.changes}
        assert differing == named, ablation.variant.word


def test_the_numbers_that_the_table_calls_the_recipes_are_its_own() -> None:
    config = plan_ablations(("ppo-inner",), ("mixed",), (0,), "fast", Path("study"))[0].config
    schedule = config.train.schedule
    assert (config.network.symmetry, config.network.parameter_sharing) == ("canonical", "kind")
    assert schedule.dense_weight is not None
    assert (schedule.dense_weight.first, schedule.dense_weight.last) == (0.3, 0.0)
    assert schedule.team_credit is not None
    assert schedule.team_credit.first == schedule.team_credit.last == 1.0
    assert schedule.entropy_weight is not None
    assert (schedule.entropy_weight.first, schedule.entropy_weight.last) == (0.015, 0.0003)
    assert (config.ppo.gamma, config.ppo.gae_lambda) == (0.98, 0.8)
    assert (config.ppo.learning_rate, config.ppo.final_learning_rate_share) == (0.004, 0.01)
    assert (config.ppo.epochs, config.ppo.minibatch_size) == (2, 512)
    assert (config.network.hidden_width, config.train.episode_steps) == (64, 50)
    assert (config.train.engine, config.ppo.advantage) == ("discs", "counterfactual")
    assert config.train.potential == "none"


def test_differences_are_by_seed_and_only_of_enough_of_them(runs: list[FinishedRun]) -> None:
    rng = np.random.default_rng(0)
    recipe, slow = rng.random((2, 4)).tolist()
    scores = {RECIPE.word: recipe, "slow": slow[:3], "wide": [0.5, None, 0.6]}
    found = read_ablations(made(runs[0], scores))
    assert [one.score.each for one in found.recipe] == [tuple(recipe)]
    assert [one.ablation.variant.word for one in found.ablated] == ["slow", "wide"]
    first, second = found.ablated
    expected = stats.ttest_rel(slow[:3], recipe[:3]).confidence_interval()
    assert first.score is not None
    assert (first.score.difference.low, first.score.difference.high) == pytest.approx(
        (expected.low, expected.high)
    )
    assert first.long_score is not None
    assert first.long_score.difference.mean == pytest.approx(-2.0 * first.score.difference.mean)
    assert second.score is second.long_score is None


def test_without_the_recipe_there_is_no_difference(runs: list[FinishedRun]) -> None:
    (one,) = read_ablations(made(runs[0], {"slow": [0.1, 0.2, 0.3]})).ablated
    assert one.score is None
    assert one.learnt.score.each == (0.1, 0.2, 0.3)


def test_the_page_says_what_was_changed_and_marks_what_differs(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    scores: dict[str, list[float | None]] = {
        RECIPE.word: [0.9, 0.91, 0.92],
        "slow": [0.8, 0.812, 0.821],
        "wide": [0.89, 0.92, 0.92],
    }
    first, second = ({}, {})
    for files in (first, second):
        write_ablations(made(runs[0], scores), tmp_path, "fast", ["mixed x seed 9: failed"])
        files.update({path.name: path.read_bytes() for path in tmp_path.iterdir()})
    assert first == second
    assert set(first) == set(FILES)
    text = first[FILES[1]].decode()
    assert text.index("- mixed x seed 9: failed") < text.index(f"## {DIFFERENCES}")
    rows = {row[0]: row[1:] for row in rows_of(text)}
    assert rows["the recipe"][1] == "**0.91** ± 0.02 (0.90, 0.91, 0.92)"
    assert rows[ABLATIONS[SLOW].choice][0] == ABLATIONS[SLOW].instead
    assert rows[ABLATIONS[SLOW].choice][2].startswith("**-0.10** [")
    assert rows[ABLATIONS[WIDE].choice][2].startswith("0.00 [")
    assert len(json.loads(first[FILES[0]])["ablated"]) == 2
