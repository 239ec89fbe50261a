"""A team of a run folder in numpy: acts as the learner does, and refuses what it cannot compute."""

from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from fresh_run import config_of_team, make_run, run_config
from sensing import sensing

from innerattn.config import Scenario
from innerattn.config.files import preset_names
from innerattn.config.range_sensor import RangeSensor
from innerattn.config.turning import ray_turns
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.evaluate import load_trained
from innerattn.nn.actions import LOG_STD_RANGE, LOG_STD_SHIFT
from innerattn.policies import PolicyInput
from innerattn.policies import columns as plain
from innerattn.policies.plain_team import LOG_STD, PlainPolicy, PlainTeam, read_plain_team
from innerattn.train import columns as trained
from innerattn.zoo import zoo_names

NOT_PLAIN = ("any", "lookout")
"""Teams of the zoo that numpy alone does not play: one of another network, one that speaks."""


@pytest.mark.parametrize("name", [one for one in zoo_names() if one not in NOT_PLAIN])
def test_it_acts_as_the_learner_does(name: str) -> None:
    config, theirs = load_trained(f"zoo:{name}")
    ours = PlainPolicy(read_plain_team(f"zoo:{name}"))
    with BatchEnv(config.scenario, 50, seed=3) as env:
        obs = env.reset()
        for _ in range(20):
            view = PolicyInput(obs)
            actions = ours.act(view)
            assert actions.shape == obs.shape[:2]
            np.testing.assert_array_equal(actions, theirs.act(view))
            obs = env.step(actions).obs


@pytest.mark.parametrize(
    ("method", "values"),
    [
        ("td-inner", {}),
        ("mappo", {"network.parameter_sharing": "kind"}),
        ("ppo-inner", {"network.symmetry": "canonical"}),
        ("td-inner", {"network.encoder": "entities", "network.hidden_width": 64}),
        ("td-inner", {"network.encoder": "entities", "network.pooling": "mean"}),
        ("ppo-max", {"network.encoder": "entities", "network.pooling": "max"}),
        ("ppo-inner", {"network.encoder": "entities", "network.pooling": "nearest"}),
        ("ppo-inner", {"network.mask_actions": True, "network.symmetry": "canonical"}),
        ("ppo-inner", {"scenario.actions": "continuous"}),
        ("ppo-inner", {"scenario.actions": "continuous", "network.symmetry": "canonical"}),
    ],
)
def test_a_fresh_run_acts_as_its_learner(
    tmp_path: Path, method: str, values: dict[str, object]
) -> None:
    run = make_run(tmp_path / "run", run_config(method, **values))
    config, theirs = load_trained(run, greedy=True)
    ours = PlainPolicy(read_plain_team(run), greedy=True)
    with BatchEnv(config.scenario, 300, seed=5) as env:
        obs = env.reset()
    obs[:100, 1, ours.team.columns.index("own.available")] = 0.0
    obs[50:90, 2] = 0.0  # a blind robot
    found, expected = ours.act(PolicyInput(obs)), theirs.act(PolicyInput(obs))
    if config.scenario.actions == "continuous":
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, atol=1e-5)
    else:
        np.testing.assert_array_equal(found, expected)
    assert len(np.unique(found)) > 1
    if config.network.mask_actions:
        assert not found[:100, 1].any()
        assert found[100:, 1].any()


@pytest.mark.parametrize("sharing", ["none", "kind"])
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_robots_of_unlike_drives_with_rays_turn_as_in_training(
    tmp_path: Path, sharing: str, actions: str
) -> None:
    values = {
        "network.symmetry": "canonical",
        "network.parameter_sharing": sharing,
        "scenario.actions": actions,
    }
    config = run_config("ppo-inner", **values)
    drives = ("unicycle", "differential") * 2
    ahead = RangeSensor(rays=5, range_m=0.9, field_of_view_deg=120.0)
    robots = [
        robot.replace(drive=drive, range_sensor=ahead)
        for robot, drive in zip(config.scenario.robots, drives, strict=True)
    ]
    scenario = config.scenario.replace(robots=robots)
    run = make_run(tmp_path / "run", config.model_copy(update={"scenario": scenario}))
    _, theirs = load_trained(run, greedy=True)
    ours = PlainPolicy(read_plain_team(run), greedy=True)
    with BatchEnv(scenario, 300, seed=5) as env:
        view = PolicyInput(env.reset())
    np.testing.assert_allclose(ours.act(view), theirs.act(view), atol=1e-5)


def test_vectors_are_drawn_as_the_learner_draws_them(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("ppo-inner", **{"scenario.actions": "continuous"}))
    config, theirs = load_trained(run, greedy=False)
    ours = PlainPolicy(read_plain_team(run), greedy=False)
    with BatchEnv(config.scenario, 1, seed=1) as env:
        view = PolicyInput(np.repeat(env.reset(), 20_000, axis=0))
    mine, others = ours.act(view), theirs.act(view)
    np.testing.assert_allclose(mine.mean(axis=0), others.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(mine.std(axis=0), others.std(axis=0), atol=0.02)
    assert mine.std(axis=0).min() > 0.2


def test_constants_of_vectors_are_those_of_training() -> None:
    assert (LOG_STD.lowest, LOG_STD.highest) == LOG_STD_RANGE
    assert pytest.approx(LOG_STD_SHIFT, abs=1e-12) == LOG_STD.shift


def test_draws_follow_from_the_seed_and_are_as_frequent_as_the_learners(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", run_config("td-inner"))
    config, theirs = load_trained(run, greedy=False)
    ours = PlainPolicy(read_plain_team(run), greedy=False)
    with BatchEnv(config.scenario, 1, seed=1) as env:
        view = PolicyInput(np.repeat(env.reset(), 20_000, axis=0))
    drawn = []
    for policy in (ours, ours, theirs):
        policy.reset(7)
        drawn.append(policy.act(view))
    np.testing.assert_array_equal(drawn[0], drawn[1])
    for robot in range(config.scenario.num_robots):
        mine, others = (np.bincount(one[:, robot], minlength=5) / 20_000 for one in drawn[1:])
        np.testing.assert_allclose(mine, others, atol=0.02)  # 4 standard errors of a difference
        assert mine.max() < 0.9


@pytest.mark.parametrize("name", [*preset_names("scenarios"), "sensing", "alone"])
def test_columns_are_those_of_training(name: str) -> None:
    alone = config_of_team(1).scenario
    known = {"sensing": sensing, "alone": lambda: alone}
    scenario = known[name]() if name in known else Scenario.preset(name)
    with closing(BatchEnv(scenario, 1)) as env:
        names = env.observation_names()
    turns = ray_turns(scenario)
    turning = asdict(trained.vector_columns(names, turns))
    assert turning.pop("width") == len(names)
    assert asdict(plain.frame_columns(names, turns)) == turning
    assert asdict(plain.entity_columns(names)) == asdict(trained.entity_columns(names))


def test_what_it_cannot_compute_is_refused() -> None:
    with pytest.raises(RunError, match=r"zoo:any: numpy alone cannot compute it: train\.method = "):
        read_plain_team("zoo:any")
    with pytest.raises(RunError, match="zoo:mixed: was trained for other observations"):
        read_plain_team("zoo:mixed", Scenario.preset("mixed-8"))
    with pytest.raises(RunError, match="zoo:mixed: was trained for other observations"):
        read_plain_team("zoo:mixed", Scenario.preset("mixed").replace(actions="continuous"))


@pytest.mark.parametrize("key", ["network.memory_width", "network.message_width"])
def test_a_policy_of_more_than_an_observation_is_refused(tmp_path: Path, key: str) -> None:
    team = read_plain_team(make_run(tmp_path / "run", run_config("ppo-inner", **{key: 8})))
    with pytest.raises(RunError, match=f"^numpy alone cannot compute it: {key} = 8$"):
        PlainPolicy(team)


def test_weights_of_another_shape_are_refused() -> None:
    team = read_plain_team("zoo:mixed")
    for name, values in (("weight", np.zeros((3, 64, 9), np.float32)), ("bias", None)):
        other = {key: one for key, one in team.tensors.items() if key != f"actor.first.{name}"}
        if values is not None:
            other[f"actor.first.{name}"] = values
        with pytest.raises(RunError, match="the weights do not fit the configuration: first"):
            PlainPolicy(PlainTeam(team.config, team.columns, other))
