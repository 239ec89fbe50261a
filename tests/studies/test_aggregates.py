"""Scores over all scenarios, and the forms that other tools read."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_run import LOGGED, made_run

from innerattn.config import RunConfig
from innerattn.evaluate.training_score import training_rescues
from innerattn.report.study.exports import marl_eval_document, rliable_document
from innerattn.report.study.page import aggregates_table, algorithm_names, means_table
from innerattn.report.table import markdown
from innerattn.stats.aggregate import interquartile_mean
from innerattn.studies.aggregates import THRESHOLDS, aggregate, performance_profile
from innerattn.studies.plan import PlannedRun
from innerattn.studies.results import Mean, Result, Values
from innerattn.studies.space import Length

SCORES = {
    ("mixed", "mappo"): {0: 0.9, 1: 0.95, 2: 0.2},
    ("single", "mappo"): {0: 1.1, 1: 0.5, 2: 0.8},
    ("mixed", "td-inner"): {0: 0.1, 1: 0.3},
    ("single", "td-inner"): {1: 0.6, 2: 0.7},
    ("single", "td-uniform"): {1: 0.6},
}


def results() -> list[Result]:
    return [
        Result(
            PlannedRun({"scenario": task, "method": name, "budget": "fast"}, seed, RunConfig(), ""),
            {"score": {"mean": score}, "long": {"score": None}},
        )
        for (task, name), scores in SCORES.items()
        for seed, score in scores.items()
    ]


@given(st.lists(st.lists(st.floats(-1, 2), min_size=1, max_size=5), min_size=1, max_size=4))
def test_profiles_against_a_plain_loop(tasks: list[list[float]]) -> None:
    found = performance_profile(dict(enumerate(scores)) for scores in tasks)
    for threshold, share in zip(THRESHOLDS, found, strict=True):
        plain = [sum(score > threshold for score in scores) / len(scores) for scores in tasks]
        assert share == pytest.approx(sum(plain) / len(plain))


def test_places_of_grids_that_set_other_keys_stand_in_one_table() -> None:
    values: dict[tuple[str, Length], Values] = {("score", "standard"): Values({0: 0.5}, None)}
    found = [
        Mean({"scenario": scenario, **keys}, (0,), values, {"standard": 25})
        for scenario, keys in (
            ("mixed", {}),
            ("office", {"network.hidden_width": 128, "train.warm_start": "hungarian"}),
        )
    ]
    table = markdown(means_table(found))
    assert "| scenario | keys | seeds |" in table
    assert "| mixed |  | 0 |" in table
    assert "| office | hidden_width = 128, warm_start = hungarian | 0 |" in table


def test_keys_that_follow_from_the_scenario_are_left_out() -> None:
    values: dict[tuple[str, Length], Values] = {("score", "standard"): Values({0: 0.5}, None)}
    found = [
        Mean(
            {"scenario": scenario, "train.env_steps": steps, "ppo.epochs": epochs},
            (0,),
            values,
            {"standard": 25},
        )
        for scenario, steps in (("mixed", 100), ("mixed-8", 200))
        for epochs in (1, 2)
    ]
    assert "| scenario | ppo.epochs | seeds |" in markdown(means_table(found))
    assert "| train.env_steps | ppo.epochs | seeds |" in markdown(
        means_table([replace(one, place=one.place | {"scenario": "mixed"}) for one in found])
    )


def test_algorithms_over_their_tasks() -> None:
    found = algorithm_names(aggregate(results(), "standard"))
    assert list(found) == ["mappo", "td-inner", "td-uniform"]
    mappo = found["mappo"]
    assert mappo.algorithm == {"method": "mappo", "budget": "fast"}
    every = [score for task in ("mixed", "single") for score in SCORES[task, "mappo"].values()]
    assert mappo.iqm is not None
    assert mappo.iqm.mean == pytest.approx(interquartile_mean(every))
    assert mappo.above == pytest.approx((1.0, 5 / 6, 4 / 6, 4 / 6, 2 / 6, 1 / 6))
    assert found["td-uniform"].iqm is None  # a single run
    assert aggregate(results(), "long") == []  # no scripts, no score
    table = markdown(aggregates_table({"standard": found}))
    assert "| mappo | standard | 6 | 0.79 [" in table
    assert "| 100 % | 83 % | 67 % | 67 % | 33 % | 17 % |" in table


def test_matrices_hold_the_seeds_that_all_tasks_share() -> None:
    document = rliable_document(algorithm_names(aggregate(results(), "standard")))
    assert document["tasks"] == ["mixed", "single"]
    assert document["seeds"] == {"mappo": [0, 1, 2], "td-inner": [1]}
    np.testing.assert_array_equal(
        np.array(document["scores"]["mappo"]), [[0.9, 1.1], [0.95, 0.5], [0.2, 0.8]]
    )
    assert document["scores"]["td-inner"] == [[0.3, 0.6]]


def test_raw_data_of_marl_eval(tmp_path: Path) -> None:
    made = [made_run(tmp_path / "made", "mixed", "td-inner", seed) for seed in (0, 1)]
    found: list[Result] = []
    for run in made:
        place = {"scenario": "mixed", "method": "td-inner", "budget": "quick"}
        planned = PlannedRun(place, run.seed, run.config, run.config.digest())
        found.append(Result(planned, run.summary, run))
    names = algorithm_names(aggregate(found, "standard"))
    document: Any = marl_eval_document(names, found)
    task = document["innerattn"]["mixed"]
    assert list(task) == ["td-inner"]
    assert list(task["td-inner"]) == ["seed_0", "seed_1"]
    for run in made:
        of_run = task["td-inner"][f"seed_{run.seed}"]
        *steps, last = of_run
        assert last == "absolute_metrics"
        assert steps == [f"step_{number}" for number in range(1, len(steps) + 1)]
        counts = [of_run[step]["step_count"] for step in steps]
        assert counts == sorted(set(counts))
        assert counts[-1] == 100 * LOGGED
        measured = of_run["absolute_metrics"]
        assert measured["score"] == [pytest.approx(run.summary["score"]["mean"])]
        assert measured["rescues"] == [run.summary["rescues_per_episode"]["mean"]]
        scripts = {name: run.summary["scripted"][name]["mean"] for name in ("random", "hungarian")}
        span = scripts["hungarian"] - scripts["random"]
        for step in steps:
            (rescues,) = of_run[step]["rescues"]
            assert of_run[step]["score"] == [pytest.approx((rescues - scripts["random"]) / span)]


def test_scores_of_longer_training_episodes_are_between_scripts_in_such(tmp_path: Path) -> None:
    """Rescues in 50 steps, beside scripts in 25, would score up to 2."""
    run = made_run(tmp_path / "made", "mixed", "td-inner", 0)
    train = run.config.train.replace(episode_steps=50, engine="discs")
    config = run.config.model_copy(update={"train": train})
    planned = PlannedRun({"scenario": "mixed"}, 0, config, "")
    found = [Result(planned, run.summary, replace(run, config=config))]
    names = algorithm_names(aggregate(found, "standard"))
    document: Any = marl_eval_document(names, found)
    ((of_run,),) = (one.values() for one in document["innerattn"]["mixed"].values())
    low, high = (training_rescues(config, name, 500, None) for name in ("random", "hungarian"))
    assert high > 1.5 * run.summary["scripted"]["hungarian"]["mean"]
    for name, step in of_run.items():
        if name == "absolute_metrics":
            assert step["score"] == [pytest.approx(run.summary["score"]["mean"])]
        else:
            assert step["score"] == [pytest.approx((step["rescues"][0] - low) / (high - low))]


@pytest.mark.parametrize(
    ("scripted", "score", "wanted"),
    [
        ({"random": 0.5, "greedy-seen": 2.5, "hungarian": 4.5}, 0.75, 1.5),
        ({"random": 0.5, "greedy-seen": 0.5, "hungarian": 4.5}, 0.75, None),
        ({"random": 0.5, "hungarian": 4.5}, 0.75, 0.75),
        ({"random": 0.5, "hungarian": 0.4}, None, None),
    ],
)
def test_the_score_as_seen_takes_the_script_that_knows_as_much(
    scripted: dict[str, float], score: float | None, wanted: float | None
) -> None:
    part = {
        "scripted": {name: {"mean": mean} for name, mean in scripted.items()},
        "score": None if score is None else {"mean": score},
        "rescues_per_episode": {"mean": 3.5},
    }
    run = PlannedRun({"scenario": "mixed"}, 0, RunConfig(), "")
    found = Result(run, {**part, "long": part})
    for length in ("standard", "long"):
        assert found.value("score_as_seen", length) == wanted  # type: ignore[arg-type]
    assert found.value("train_seconds", "standard") is None
    assert found.value("train_cpu_seconds", "standard") is None


def test_the_seconds_of_a_training_are_those_of_its_run(tmp_path: Path) -> None:
    run = made_run(tmp_path, "mixed", "td-inner", 0)
    planned = PlannedRun({"scenario": "mixed"}, 0, run.config, "")
    run = replace(run, info=replace(run.info, cpu_seconds=12.5))
    found = Result(planned, run.summary, run)
    assert found.value("train_seconds", "standard") == run.info.seconds
    assert found.value("train_cpu_seconds", "standard") == 12.5
