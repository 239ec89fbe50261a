"""Teams with continuous actions are trained, measured and repeated as others are."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from innerattn.config import RunConfig, Scenario
from innerattn.errors import RunError
from innerattn.evaluate import load_trained, run_episodes
from innerattn.policies.scripted.dispatch import RandomPolicy
from innerattn.records.run_folder import newest_weights
from innerattn.train import train
from innerattn.train.weights import digest_of

Configure = Callable[..., RunConfig]

ROBOT = {"abilities": ("help",), "max_speed_mps": 1.0, "mass_kg": 1.0}
TINY = {
    "situation": "single",
    "robots": [{"name": "one", "kind": "helper", **ROBOT}],
    "tasks": [{"name": "task", "needs": ["help"]}],
    "arena_half_width_m": 0.8,
    "actions": "continuous",
}
"""One robot in a small arena, and one victim at a time."""
SHORT = {
    "train.method": "ppo-inner",
    "scenario": TINY,
    "train.env_steps": 40_000,
    "train.num_envs": 64,
    "train.log_every_env_steps": 10_000,
    "network.hidden_width": 32,
    "network.symmetry": "canonical",
    "ppo.minibatch_size": 400,
}


def given(values: dict[str, Any]) -> RunConfig:
    """A run of a whole scenario and single values."""
    sections: dict[str, Any] = {}
    for key, value in values.items():
        section, dot, name = key.partition(".")
        if dot:
            sections.setdefault(section, {})[name] = value
        else:
            sections[section] = value
    return RunConfig.model_validate(sections)


@pytest.mark.long
@pytest.mark.parametrize("method", ["ppo-inner", "mappo"])
def test_a_team_learns_to_rescue(tmp_path: Path, method: str) -> None:
    run = train(given({**SHORT, "train.threads": 1, "train.method": method}), tmp_path / "run")
    config, policy = load_trained(run)
    learnt = run_episodes(policy, config.scenario, 100, seed=5).rescue_counts().mean()
    chance = RandomPolicy(config.scenario)
    by_chance = run_episodes(chance, config.scenario, 100, seed=5).rescue_counts().mean()
    assert learnt > 2.0
    assert learnt > 3.0 * by_chance


def test_records_hold_the_forces_and_faults_come_as_ever(
    small_config: Configure, tmp_path: Path
) -> None:
    faults = [{"robot": "food_0", "kind": "motor_gain", "value": 0.3, "onset_step": 5}]
    config = small_config(
        **{"train.method": "ppo-uniform", "scenario.actions": "continuous"},
        **{"scenario.faults": faults, "train.potential": "hungarian"},
        **{"train.potential_env_steps": 1000},
    )
    run = train(config, tmp_path / "run")
    _, policy = load_trained(run, greedy=False)
    record = run_episodes(policy, config.scenario, 3, seed=1, record=("actions",))
    actions = record.steps["actions"]
    assert (actions.shape, actions.dtype) == ((3, 25, 4, 2), np.float32)
    assert 0.1 < np.abs(actions).max() <= 1.0
    assert len(np.unique(actions)) > 100


def test_one_and_two_threads_give_one_result(small_config: Configure, tmp_path: Path) -> None:
    values = {"train.method": "mappo", "scenario.actions": "continuous"}
    found = [
        digest_of(
            newest_weights(
                train(small_config(**values, **{"train.threads": threads}), tmp_path / str(number))
            )
        )
        for number, threads in enumerate((1, 2, 2))
    ]
    assert found[0] == found[1] == found[2]


def test_discrete_and_continuous_teams_are_not_taken_for_each_other(
    small_config: Configure, tmp_path: Path
) -> None:
    run = train(
        small_config(**{"train.method": "mappo", "scenario.actions": "continuous"}),
        tmp_path / "run",
    )
    with pytest.raises(RunError, match="was trained for other observations"):
        load_trained(run, Scenario.preset("mixed"))
