"""Messages in worlds: whom robots hear, and trained teams that act as they were trained."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from innerattn.config import Communication, EvaluateConfig, Fault, RunConfig, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.evaluate import load_trained
from innerattn.evaluate.bounds.measure import bounds_of_run
from innerattn.evaluate.measure import evaluate_policy
from innerattn.learn.messages import MessageRows
from innerattn.learn.types import RememberingLearner
from innerattn.nn import ListeningActor
from innerattn.policies import PolicyInput
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train import load_policy, train
from innerattn.train.build import build_learner
from innerattn.train.columns import hearing
from innerattn.train.weights import digest_of

Configure = Callable[..., RunConfig]
FAULTS = tuple(
    Fault(robot=robot, kind=kind, value=0.3)
    for robot, kind in (
        ("food_0", "lost_communication"),
        ("food_1", "unavailable"),
        ("medical_0", "blackout"),
        ("navigation_0", "unavailable"),
    )
)
LIMITS = {
    "nothing": None,
    "range": Communication(range_m=0.8),
    "late": Communication(delay_steps=2),
    "lossy, late": Communication(delay_steps=1, loss=0.3, range_m=1.5),
}


@pytest.mark.parametrize("limits", LIMITS.values(), ids=LIMITS)
@pytest.mark.parametrize("preset", ["mixed", "mixed-sight"])
def test_robots_hear_whom_worlds_say(preset: str, limits: Communication | None) -> None:
    """All whom `BatchEnv.heard` names, unless they are not available when they speak."""
    scenario = Scenario.preset(preset).replace(communication=limits, faults=FAULTS)
    if preset == "mixed-sight" and limits is None:  # no column tells who is deaf
        scenario = scenario.replace(faults=FAULTS[1:2] + FAULTS[3:])
    config = RunConfig.model_validate(
        {
            "scenario": scenario,
            "network": {"message_width": 4, "hidden_width": 16},
            "train": {"method": "mappo"},
        }
    )
    draws, later = np.random.default_rng(0), 0
    with closing(BatchEnv(scenario, 60, seed=3, num_threads=1)) as env:
        learner = build_learner(config, env)
        actor, rows = learner.actor, learner._messages
        assert isinstance(actor, ListeningActor)
        assert isinstance(rows, MessageRows)
        available = env.observation_names().index("own.available")
        delay = scenario.message_delay_steps
        obs = env.reset()
        spoken: list[np.ndarray] = []
        silenced = 0
        for step in range(scenario.episode_steps - 1):
            spoken.append(obs[..., available].copy() > 0.5)
            learner.act(torch.from_numpy(obs))
            width, now = env.obs_width, rows.now
            said = now[..., width + 1 : -1] if delay else now[..., :width]
            found = actor.messages._hears(now[..., :width], said).permute(2, 0, 1).numpy()
            expected = env.heard()
            if step >= delay:
                silenced += (expected & ~spoken[step - delay][:, None, :]).sum()
                expected = expected & spoken[step - delay][:, None, :]
            np.testing.assert_array_equal(found, expected)
            later += expected.sum()
            obs = env.step(draws.integers(0, 5, (60, env.num_robots))).obs.copy()
    assert later > 1_000
    assert silenced > 0 or limits is None


def test_columns_of_hearing() -> None:
    names = ["own.available"]
    names += [f"teammate_{k}.{one}" for k in (0, 1) for one in _MATE]
    found = hearing(names, 3)
    assert (found.sends, found.heard, found.seen, found.delay) == (0, (3, 7), (), 3)
    assert found.places == ((1, 2), (5, 6))
    for extra in ("seen", "heard"):
        names += [f"teammate_{k}.{extra}" for k in (0, 1)]
        found = hearing(names, 0)
        assert found.seen == (9, 10)
        assert found.heard == (() if extra == "seen" else (11, 12))
    assert hearing(["own.available", "victim_0.present"], 0).places == ()


_MATE = ("relative_position.x", "relative_position.y", "available", "load")


RADIO = {
    "train.method": "ppo-inner",
    "network.message_width": 8,
    "network.symmetry": "canonical",
    "scenario.communication": {"range_m": 1.2, "delay_steps": 2, "loss": 0.1},
}


@pytest.fixture(scope="module")
def run(small_config: Configure, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A team that hears late, limited in range."""
    return train(small_config(**RADIO), tmp_path_factory.mktemp("messages") / "run")


def test_a_trained_team_acts_as_it_was_trained(run: Path) -> None:
    config, policy = load_trained(run, greedy=True)
    _, learner = load_policy(run)
    assert isinstance(learner, RememberingLearner)
    silent = load_policy(run)[1]
    for name, value in silent.learner.actor.named_parameters():
        if name.startswith("messages.output"):
            value.data.zero_()
    learner.forget()
    policy.reset(0)
    differ = 0
    with closing(BatchEnv(config.scenario, 20, seed=1, num_threads=1)) as env:
        obs = env.reset()
        for _ in range(10):
            actions = policy.act(PolicyInput(obs))
            expected = learner.act(torch.from_numpy(obs), greedy=True).numpy()
            np.testing.assert_array_equal(actions, expected)
            outputs = learner.learner._acted[1]
            silent.act(torch.from_numpy(obs), greedy=True)
            differ += int(not torch.allclose(outputs, silent.learner._acted[1]))
            obs = env.step(actions).obs.copy()
    assert differ == 8  # nobody hears anything in the first two steps


def test_it_acts_where_messages_arrive_in_time_alone(run: Path) -> None:
    worlds = load_policy(run)[0].scenario
    assert load_trained(run, worlds.replace(rescue_radius_m=0.2))
    other = worlds.replace(communication=worlds.communication.replace(delay_steps=1))
    with pytest.raises(RunError, match=r"communication.delay_steps = 2: must be 2 here, not 1, be"):
        load_trained(run, other)


def test_bounds_are_not_known(run: Path) -> None:
    with pytest.raises(RunError, match="and robots without memory and messages"):
        bounds_of_run(run, states=2)


def test_threads_change_no_more_than_rounding(
    small_config: Configure, run: Path, tmp_path: Path
) -> None:
    """MKL adds up some products of two threads in another order, on Intel's processors alone."""
    for name, threads in (("one", 1), ("two", 2), ("again", 2)):
        values = {**RADIO, "network.parameter_sharing": "kind", "train.threads": threads}
        train(small_config(**values), tmp_path / name)
    files = {name: newest_weights(tmp_path / name) for name in ("one", "two", "again")}
    assert digest_of(files["two"]) == digest_of(files["again"]) != digest_of(newest_weights(run))
    one, two = (load_file(files[name]) for name in ("one", "two"))
    for name, values in one.items():
        torch.testing.assert_close(values, two[name], rtol=0.0, atol=1e-6)


def test_rough_products_do_not_break_them(small_config: Configure, tmp_path: Path) -> None:
    for pooling in ("attention", "max", "nearest"):
        values = {"network.precision": "bfloat16", "network.message_pooling": pooling}
        found = train(small_config(**RADIO, **values), tmp_path / pooling)
        assert read_info(found).state == "done"


LOOKOUT: dict[str, Any] = {
    "max_victims": 1,
    "robots": [
        {
            "name": "food_0",
            "kind": "food",
            "abilities": ["food"],
            "max_speed_mps": 1.5,
            "mass_kg": 0.5,
            "sight_m": 0.25,
        },
        {
            "name": "lookout_0",
            "kind": "lookout",
            "abilities": ["information"],
            "max_speed_mps": 0.2,
            "mass_kg": 0.5,
        },
    ],
    "tasks": [{"name": "hungry", "needs": ["food"]}],
}
"""One robot sees the victim and cannot help; the other can help and sees hardly anything."""


@pytest.mark.slow
def test_a_lookout_learns_to_tell_where_the_victim_is(tmp_path: Path) -> None:
    found = []
    for width in (16, 0):
        config = RunConfig.model_validate(
            {
                "scenario": LOOKOUT,
                "network": {
                    "hidden_width": 64,
                    "symmetry": "canonical",
                    "parameter_sharing": "kind",
                    "message_width": width,
                },
                "ppo": {
                    "gamma": 0.98,
                    "gae_lambda": 0.8,
                    "learning_rate": 0.004,
                    "epochs": 2,
                    "minibatch_size": 512,
                },
                "train": {
                    "method": "ppo-inner",
                    "env_steps": 300_000,
                    "num_envs": 512,
                    "threads": 1,
                    "compile": "off",
                },
            }
        )
        _, policy = load_trained(train(config, tmp_path / str(width)))
        settings = EvaluateConfig(episodes=1, score_episodes=400, long_episodes=2)
        summary = evaluate_policy(policy, config.scenario, settings, num_threads=1).summary
        found.append(summary.to_json()["rescues_per_episode"])
    assert found[0]["low"] > 2.0 * found[1]["high"]
