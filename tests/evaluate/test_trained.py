"""A trained run as a policy: who sees what, where somebody reaches into the worlds."""

from contextlib import closing

import numpy as np

from innerattn.config import Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.evaluate.trained import TrainedPolicy, load_trained
from innerattn.policies import PolicyInput
from innerattn.train.build import build_learner


def test_where_each_sees_a_blind_robot_is_blind_alone() -> None:
    """No fault of the scenario says that a sense may fail."""
    scenario = Scenario.preset("mixed")
    shared, own = (load_trained("zoo:any", scenario, each_sees=one)[1] for one in (False, True))
    with closing(BatchEnv(scenario, 64, seed=2, num_threads=1)) as env:
        obs = env.reset()
    seen = own.act(PolicyInput(obs))
    assert (seen == shared.act(PolicyInput(obs))).mean() > 0.99
    blind = obs.copy()
    blind[:, 0] = 0.0
    found = own.act(PolicyInput(blind))
    np.testing.assert_array_equal(found[:, 1:], seen[:, 1:])
    assert (found[:, 0] != seen[:, 0]).any()
    assert (shared.act(PolicyInput(blind))[:, 1:] != seen[:, 1:]).any()


def attending(name: str, **scenario: object) -> tuple[Scenario, TrainedPolicy]:
    """Worlds of a preset, and an untrained team whose actors attend to each other."""
    given = {"network.encoder": "entities", "network.hidden_width": 64, "train.method": "ppo-inner"}
    given |= {f"scenario.{key}": value for key, value in scenario.items()}
    config = load_run_config(name, budget="fast", overrides=given)
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        return config.scenario, TrainedPolicy(build_learner(config, env), "team", greedy=True)


def test_the_attention_of_actors_is_recorded_as_they_act() -> None:
    scenario, policy = attending("double")
    record = run_episodes(policy, scenario, 3, 7, record=("obs", "actor_attention", "attention"))
    weights = record.steps["actor_attention"]
    assert weights.shape == (3, scenario.episode_steps, 2, 4, 4)
    np.testing.assert_allclose(weights.sum(-1), 1.0, atol=1e-5)
    assert not np.diagonal(weights, axis1=-2, axis2=-1).any()
    assert record.steps["attention"].shape[2] == 4  # that of the critic has heads of its own
    for step in (0, 11, 24):
        view = PolicyInput(record.steps["obs"][:, step])
        np.testing.assert_array_equal(weights[:, step], policy.actor_attention(view))


def test_without_such_attention_none_is_recorded() -> None:
    policy = load_trained("zoo:mixed")[1]
    assert not run_episodes(
        policy, Scenario.preset("mixed"), 2, 7, record=("actor_attention",)
    ).steps


def test_none_is_recorded_where_rows_have_the_nearest_teammates_first() -> None:
    scenario, policy = attending("mixed", observed_teammates=3)
    assert not run_episodes(policy, scenario, 2, 7, record=("actor_attention",)).steps
