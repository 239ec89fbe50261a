"""Whole evaluations of a short run and of a scripted policy."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from innerattn.config import EvaluateConfig, Fault, Scenario, load_run_config
from innerattn.errors import ConfigError, RunError
from innerattn.evaluate import (
    evaluate_policy,
    evaluate_run,
    load_trained,
    read_records,
    scripted_policy,
)
from innerattn.measures.summary import summarise
from innerattn.policies.scripted.dispatch import GreedyPolicy
from innerattn.records.record import FIELDS
from innerattn.train import train

SETTINGS = EvaluateConfig(
    episodes=6, score_episodes=20, long_episodes=4, long_episode_steps=40, seed=1
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    config = load_run_config(
        "mixed",
        overrides={
            "train.env_steps": 240,
            "train.num_envs": 12,
            "train.threads": 1,
            "td.warmup_env_steps": 120,
            "td.batch_size": 16,
            "network.hidden_width": 16,
        },
    )
    return train(config, tmp_path_factory.mktemp("runs") / "short")


def test_evaluation_of_a_run(run: Path, tmp_path: Path) -> None:
    done: list[tuple[int, int]] = []
    evaluation = evaluate_run(
        run, settings=SETTINGS, progress=lambda part, total: done.append((part, total))
    )
    summary = evaluation.summary
    assert (summary.policy, summary.method, summary.episodes) == ("short", "td-inner", 6)
    assert (summary.standard.episodes, summary.standard.episode_steps) == (20, 25)
    assert (summary.long.episodes, summary.long.episode_steps) == (4, 40)
    assert done[-1] == (96, 96)
    for heads in summary.attention_entropy.values():
        assert len(heads) == 4
        assert all(0 < nats <= np.log(3) + 1e-6 for nats in heads)
    recorded, rest = evaluation.records[:2]
    assert (recorded.policy, rest.policy) == ("td-inner", "td-inner")
    assert (rest.first_episode, rest.num_episodes, rest.steps) == (6, 14, {})
    weights = recorded.steps["attention"]
    assert weights.shape == (6, 25, 4, 4, 4)
    np.testing.assert_allclose(weights.sum(-1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(np.diagonal(weights, axis1=-2, axis2=-1), 0.0)

    evaluation.write(tmp_path / "evaluation")
    written = json.loads((tmp_path / "evaluation" / "summary.json").read_text())
    assert written == summary.to_json()
    # Every figure can be computed again from the files alone.
    records = read_records(tmp_path / "evaluation")
    by_length: dict[int, dict[str, list]] = {25: {}, 40: {}}
    for record in records:
        group = by_length[record.scenario.episode_steps]
        group.setdefault(record.policy, []).append(record)
    # Scripted policies' steps are measured and not kept.
    found = summarise("short", records[0], by_length[25], by_length[40])
    assert replace(found, standard=replace(found.standard, measures={})) == replace(
        summary, standard=replace(summary.standard, measures={})
    )
    measured = summary.standard.measures
    assert list(measured) == ["td-inner", "random", "greedy", "hungarian"]
    assert measured["td-inner"] == found.standard.measures["td-inner"]
    assert isinstance(measured["hungarian"]["choices"], int)
    assert found.standard.measures["hungarian"]["choices"] is None


def test_the_same_evaluation_twice_is_the_same(run: Path) -> None:
    one, other = (evaluate_run(run, settings=SETTINGS).summary for _ in range(2))
    assert one == other
    seeded = SETTINGS.model_copy(update={"seed": 2})
    assert evaluate_run(run, settings=seeded).summary != one


def test_greedy_actions_are_the_likeliest(run: Path) -> None:
    config, drawing = load_trained(run, greedy=False)
    _, likeliest = load_trained(run, greedy=True)
    with torch.no_grad():
        settings = SETTINGS.model_copy(update={"score_episodes": 6, "long_episodes": 1})
        drawn, chosen = (
            evaluate_policy(policy, config.scenario, settings).records[0].steps
            for policy in (drawing, likeliest)
        )
        again = load_trained(run)[1]._learner.act(
            torch.tensor(chosen["obs"].reshape(-1, *chosen["obs"].shape[2:])), greedy=True
        )
    np.testing.assert_array_equal(chosen["actions"].reshape(-1, 4), again.numpy())
    assert not np.array_equal(drawn["actions"], chosen["actions"])


def test_worlds_that_look_otherwise_are_refused(run: Path) -> None:
    with pytest.raises(RunError, match="'mixed' there, 'single' here") as caught:
        evaluate_run(run, scenario=Scenario.preset("single"), settings=SETTINGS)
    assert "\n" not in str(caught.value)


def test_worlds_that_look_alike_are_allowed(run: Path) -> None:
    worlds = Scenario.preset("double")
    summary = evaluate_run(run, scenario=worlds, settings=SETTINGS).summary
    assert summary.situation == "double"


def test_without_attention_none_is_recorded_or_reported(tmp_path: Path) -> None:
    config = load_run_config(
        "mixed",
        "mappo",
        overrides={
            "train.env_steps": 600,
            "train.num_envs": 12,
            "train.threads": 1,
            "train.log_every_env_steps": 300,
            "network.hidden_width": 16,
        },
    )
    run = train(config, tmp_path / "plain")
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    assert [line["attention_entropy"] for line in lines] == [{}, {}]
    assert lines[-1]["updates"] > 0
    evaluation = evaluate_run(run, settings=SETTINGS)
    evaluation.write(tmp_path / "evaluation")
    summary = json.loads((tmp_path / "evaluation" / "summary.json").read_text())
    assert (summary["policy"], summary["method"]) == ("plain", "mappo")
    assert summary["attention_entropy"] == summary["attention_entropy_share"] == {}
    recorded = read_records(tmp_path / "evaluation")[0]
    assert list(recorded.steps) == [
        name
        for name in FIELDS
        if name
        not in ("headings", "charge", "load", "heard", "rays", "attention", "actor_attention")
    ]


def test_a_policy_is_not_measured_against_itself() -> None:
    class Mine(GreedyPolicy):
        name = "hungarian"

    worlds = Scenario.preset("mixed")
    with pytest.raises(ValueError, match=r"name = 'hungarian'.*HungarianPolicy.*a Mine needs"):
        evaluate_policy(Mine(worlds), worlds, SETTINGS)


def test_faults_after_the_second_length_are_refused() -> None:
    late = Fault(robot="food_0", kind="blackout", value=1.0, onset_step=40)
    worlds = Scenario.preset("mixed").replace(episode_steps=60, faults=(late,))
    with pytest.raises(ConfigError, match=r"onset_step = 40: .*long_episode_steps = 40"):
        evaluate_policy(scripted_policy("greedy", worlds), worlds, SETTINGS)


def test_a_scripted_policy_is_measured_once() -> None:
    worlds = Scenario.preset("mixed")
    evaluation = evaluate_policy(scripted_policy("hungarian", worlds), worlds, SETTINGS)
    summary = evaluation.summary
    assert (summary.policy, summary.method) == ("hungarian", "hungarian")
    assert summary.standard.score is not None
    assert summary.standard.score.mean == pytest.approx(1.0)
    assert summary.standard.rescues_per_episode == summary.standard.scripted["hungarian"]
    assert summary.attention_entropy == {}
    assert [record.policy for record in evaluation.records] == [
        "hungarian", "hungarian", "random", "greedy", "hungarian", "random", "greedy",
    ]  # fmt: skip
    assert sum(map(sum, (t.values() for t in summary.cooperation.values()))) == len(
        evaluation.records[0].rescues
    )
