"""Who can act: what worlds say of it is what actions do, and all views say it."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest
import torch
from test_batteries import powered

from innerattn.config import Fault, Scenario
from innerattn.envs import BatchEnv, parallel_env
from innerattn.envs.torchrl import RescueTorchRLEnv

FAULTS = (
    Fault(robot="food_0", kind="unavailable", value=0.5),
    Fault(robot="medical_0", kind="unavailable", value=1.0, onset_step=3, duration_steps=4),
    Fault(robot="food_1", kind="blackout", value=1.0),
)
SOMETIMES = Scenario.preset("mixed").replace(faults=FAULTS)
WORLDS = {
    "faults": SOMETIMES,
    "leaving": SOMETIMES.replace(unavailable_robots="leave", faults=FAULTS[1:]),
    "batteries": powered(capacity_j=6.0),
}
ENVS = 20


@pytest.mark.parametrize("name", WORLDS)
def test_only_those_who_can_act_heed_what_they_are_told(name: str) -> None:
    """Without contacts, an action changes the velocity of those who can act, and of no other."""
    scenario = WORLDS[name].replace(engine="none", actions="discrete")
    with (
        closing(BatchEnv(scenario, ENVS, seed=1, num_threads=1)) as env,
        closing(BatchEnv(scenario, ENVS, seed=1, num_threads=1)) as other,
    ):
        source = np.random.default_rng(0)
        env.reset()
        other.reset()
        shares = []
        for _ in range(12):
            other.restore(env.snapshot())
            can = env.can_act()
            shares.append(can.mean())
            told = source.integers(0, 5, can.shape)
            changed = (told + source.integers(1, 5, can.shape)) % 5
            env.step(told)
            other.step(changed)
            heeded = (env.velocities() != other.velocities()).any(axis=2)
            assert not heeded[~can].any()
            # A wall stops whoever it stops, and those who leave with this step stand still.
            moving = (np.abs(env.positions()) < 0.8).all(axis=2) & env.present()
            assert heeded[can & moving].all()
        assert min(shares) < 1.0


def test_a_mask_leaves_those_who_cannot_act_to_stay() -> None:
    with closing(BatchEnv(SOMETIMES, ENVS, num_threads=1)) as env:
        env.reset()
        mask, can = env.action_mask(), env.can_act()
    assert mask.shape == (ENVS, 4, 5)
    assert mask.dtype == np.bool_
    assert not can.all()
    assert mask[..., 0].all()
    for action in range(1, 5):
        np.testing.assert_array_equal(mask[..., action], can)


def test_pettingzoo_tells_each_robot() -> None:
    env = parallel_env(SOMETIMES, seed=3)
    _, infos = env.reset()
    found = []
    for step in range(8):
        mask = env.unwrapped._env.action_mask()[0]
        for robot, row in zip(env.possible_agents, mask, strict=True):
            np.testing.assert_array_equal(infos[robot]["action_mask"], row)
            assert infos[robot]["action_mask"].dtype == np.int8
        can = infos["medical_0"]["action_mask"][1:].all()
        assert can == (not 3 <= step < 7)
        found.append(can)
        *_, infos = env.step(dict.fromkeys(env.agents, 0))
    assert set(found) == {True, False}


def test_robots_that_leave_have_no_mask() -> None:
    env = parallel_env(WORLDS["leaving"], seed=3)
    _, infos = env.reset()
    for _ in range(5):
        live = list(env.agents)
        *_, infos = env.step(dict.fromkeys(live, 0))
        assert all("action_mask" in infos[robot] for robot in env.agents)
    assert "medical_0" not in env.agents


def test_gymnasium_tells_the_team() -> None:
    env = gymnasium.make("innerattn/Rescue-v0", scenario=SOMETIMES, seed=3).unwrapped
    _, info = env.reset()
    for _ in range(6):
        wanted = env._env.action_mask()
        np.testing.assert_array_equal(info["action_mask"], wanted[0])
        assert info["action_mask"].dtype == np.int8
        np.testing.assert_array_equal(env.action_masks(), wanted.reshape(-1))
        *_, info = env.step(np.zeros(4, np.int64))


def test_torchrl_tells_each_kind() -> None:
    from torchrl.envs.utils import check_env_specs

    env = RescueTorchRLEnv(SOMETIMES, 6, seed=3)
    check_env_specs(env)
    found = env.reset()
    for _ in range(6):
        wanted = torch.from_numpy(env._worlds.action_mask())
        for kind, own in env._robots.items():
            assert torch.equal(found[kind, "action_mask"], wanted[:, own])
        chosen = env.action_spec.zero()
        found = env.step(found.update(chosen))["next"]
    assert not wanted.all()


@pytest.mark.parametrize(
    "scenario", [Scenario.preset("mixed"), SOMETIMES.replace(actions="continuous")]
)
def test_where_all_can_act_or_actions_are_forces_nothing_is_said(scenario: Scenario) -> None:
    env = parallel_env(scenario, seed=3)
    _, infos = env.reset()
    assert all(info == {} for info in infos.values())
    single = gymnasium.make("innerattn/Rescue-v0", scenario=scenario).unwrapped
    assert single.reset()[1] == {}
    specs = RescueTorchRLEnv(scenario, 2).observation_spec
    assert set(specs["food"].keys()) == {"observation"}
