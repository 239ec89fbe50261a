"""Learning, small and sure: two robots, one victim at a time; every method beats random."""

from pathlib import Path

import pytest

from innerattn.config import EvaluateConfig, RunConfig, Scenario, load_run_config
from innerattn.evaluate.measure import evaluate_policy
from innerattn.evaluate.trained import load_trained
from innerattn.train import train

LEARNING_RATE = 0.003


@pytest.mark.parametrize(
    "method",
    [
        pytest.param("td-uniform", marks=pytest.mark.long),
        "ppo-inner",
        *(
            pytest.param(one, marks=pytest.mark.slow)
            for one in ("td-inner", "ppo-uniform", "mappo")
        ),
    ],
)
@pytest.mark.long
def test_two_robots_learn_to_rescue(method: str, tmp_path: Path) -> None:
    team = Scenario()
    scenario = Scenario(
        situation="single",
        robots=(team.robots[0], team.robots[3]),
        tasks=(team.tasks[0],),
        rescue_radius_m=0.2,
        spawn_clearance_m=0.25,
    )
    config = RunConfig.model_validate(
        {
            "scenario": scenario,
            "network": {"hidden_width": 32, "attention_heads": 2},
            "td": {"learning_rate": LEARNING_RATE, "batch_size": 128},
            "ppo": {"learning_rate": LEARNING_RATE, "minibatch_size": 400},
            "train": {"method": method, "env_steps": 40_000, "threads": 1},
        }
    )
    _, policy = load_trained(train(config, tmp_path / "run"))
    settings = EvaluateConfig(episodes=1, score_episodes=400, long_episodes=2)
    found = evaluate_policy(policy, scenario, settings, num_threads=1).summary.to_json()
    random = found["scripted"]["random"]["high"]
    assert found["rescues_per_episode"]["low"] > 1.0 > 5 * random


@pytest.mark.long
def test_the_fast_budget_learns_within_seconds(tmp_path: Path) -> None:
    given = {"train.env_steps": 150_000, "train.threads": 1, "train.compile": "off"}
    config = load_run_config("single", "mappo", "fast", overrides=given)
    _, policy = load_trained(train(config, tmp_path / "run"))
    settings = EvaluateConfig(episodes=1, score_episodes=400, long_episodes=2)
    found = evaluate_policy(policy, config.scenario, settings, num_threads=1).summary.to_json()
    # A tenth of the worlds' steps that the budget has; the script rescues 2.7.
    assert found["rescues_per_episode"]["low"] > 1.0
