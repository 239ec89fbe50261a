"""A team of a run folder in numpy: acts as the learner does, and refuses what it cannot compute."""

from pathlib import Path

import numpy as np
import pytest
from fresh_run import make_run, run_config

from innerattn.config import Scenario
from innerattn.config.files import preset_names
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.evaluate import load_trained
from innerattn.policies import PolicyInput
from innerattn.policies.plain_team import PlainPolicy, PlainTeam, frame_columns, read_plain_team
from innerattn.train.columns import vector_columns
from innerattn.zoo import zoo_names


@pytest.mark.parametrize("name", [one for one in zoo_names() if one != "any"])
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
    ],
)
def test_a_fresh_run_acts_as_its_learner(
    tmp_path: Path, method: str, values: dict[str, object]
) -> None:
    run = make_run(tmp_path / "run", run_config(method, **values))
    config, theirs = load_trained(run, greedy=True)
    ours = PlainPolicy(read_plain_team(run), greedy=True)
    with BatchEnv(config.scenario, 300, seed=5) as env:
        view = PolicyInput(env.reset())
        np.testing.assert_array_equal(ours.act(view), theirs.act(view))


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


@pytest.mark.parametrize("name", preset_names("scenarios"))
def test_the_same_columns_turn_as_in_training(name: str) -> None:
    with BatchEnv(Scenario.preset(name), 1) as env:
        names = env.observation_names()
    ours, theirs = frame_columns(names), vector_columns(names)
    assert (ours.vectors, ours.handed, ours.anchors) == (
        theirs.vectors,
        theirs.handed,
        theirs.anchors,
    )


def test_what_it_cannot_compute_is_refused() -> None:
    with pytest.raises(RunError, match=r"zoo:any: numpy alone cannot compute it: train\.method = "):
        read_plain_team("zoo:any")
    with pytest.raises(RunError, match="zoo:mixed: was trained for other observations"):
        read_plain_team("zoo:mixed", Scenario.preset("mixed-8"))


def test_weights_of_another_shape_are_refused() -> None:
    team = read_plain_team("zoo:mixed")
    for name, values in (("weight", np.zeros((3, 64, 9), np.float32)), ("bias", None)):
        other = {key: one for key, one in team.tensors.items() if key != f"actor.first.{name}"}
        if values is not None:
            other[f"actor.first.{name}"] = values
        with pytest.raises(RunError, match="the weights do not fit the configuration: first"):
            PlainPolicy(PlainTeam(team.config, team.columns, other))
