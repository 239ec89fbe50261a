"""Scripts in worlds with loads: robots refill them, and nobody goes where it cannot help."""

import numpy as np
import pytest
import scripted_play

from innerattn.config import Battery, Depot, Scenario, Station
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy

SCRIPTS = pytest.mark.parametrize("name", ["greedy", "hungarian", "planner", "oracle"])


def loaded(depots: int = 2, load: int = 2, **changed: object) -> Scenario:
    places = ((-0.6, -0.6), (0.6, 0.6))[:depots]
    return Scenario().replace(
        robots=tuple(robot.replace(load=load) for robot in Scenario().robots),
        depots=tuple(Depot(position_m=at) for at in places),
        **{"episode_steps": 300, "engine": "discs", **changed},
    )


def played(name: str, scenario: Scenario) -> tuple[int, float]:
    """Rescues in an episode of each world, and the share of steps that a load was used up."""
    return scripted_play.played(name, scenario, BatchEnv.load)


@SCRIPTS
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_robots_that_refill_go_on_with_rescues(name: str, actions: str) -> None:
    rescues, used_up = played(name, loaded(actions=actions))
    alone, used_up_alone = played(name, loaded(0, actions=actions))
    assert used_up < 0.3
    assert used_up_alone > 0.5
    assert alone <= 16 * 4  # two robots bring food, two rescues each
    assert rescues > 4 * alone


@SCRIPTS
def test_loads_that_last_change_nothing(name: str) -> None:
    lasting = loaded(depots=0, load=1000, episode_steps=50)
    plain = lasting.replace(robots=Scenario().robots)
    assert played(name, lasting) == (played(name, plain)[0], 0.0)


@SCRIPTS
@pytest.mark.parametrize(("share", "goes"), [(0.0, False), (0.5, True), (1.0, True)])
def test_who_has_nothing_left_goes_to_the_depot(name: str, share: float, goes: bool) -> None:
    scenario = loaded(depots=1, situation="single")
    env = BatchEnv(scenario, 1, seed=2, num_threads=1)
    env.reset()
    victims = env.victims()
    victims["task"], victims["x"], victims["y"] = 0, 0.8, 0.8
    env.set_victims(victims)
    env.set_motion(np.zeros((1, 4, 2)) + np.arange(4)[:, None] * 0.11, np.zeros((1, 4, 2)))
    state = WorldState.of(env)._replace(load=np.array([[share, share, 0.5, share]], np.float32))
    actions = scripted_policy(name, scenario).act(PolicyInput(env.observe(), state))[0]
    drives = np.array([0, 1, -1, 1, -1])[actions]
    helpers = drives[[0, 1, 3]]
    assert (helpers > 0).any() if goes else (helpers < 0).all()
    assert drives[2] < 0  # nobody needs it, and it is not full


@SCRIPTS
def test_robots_with_a_battery_too_go_on(name: str) -> None:
    battery = Battery(capacity_j=20.0, per_m_j=2.0, idle_w=1.0)
    scenario = loaded()
    both = scenario.replace(
        robots=tuple(robot.replace(battery=battery) for robot in scenario.robots),
        stations=(Station(position_m=(-0.6, 0.6), radius_m=0.35, recharge_w=20.0),),
    )
    rescues, used_up = played(name, both)
    assert rescues > 0.4 * played(name, scenario)[0]
    assert used_up < 0.4
    policy = scripted_policy(name, both)
    env = BatchEnv(both, 16, seed=1, num_threads=1)
    obs, empty = env.reset(), []
    for _ in range(299):
        obs = env.step(policy.act(PolicyInput(obs, WorldState.of(env)))).obs
        empty.append((env.charge() == 0.0).mean())
    assert np.mean(empty) < 0.02


def test_without_depots_nobody_waits_where_no_rescue_can_be() -> None:
    scenario = loaded(depots=0, situation="single")
    env = BatchEnv(scenario, 1, seed=2, num_threads=1)
    env.reset()
    victims = env.victims()
    victims["task"], victims["x"], victims["y"] = 0, 0.8, 0.8
    env.set_victims(victims)
    state = WorldState.of(env)._replace(load=np.array([[1, 1, 1, 0]], np.float32))
    places = np.array([[[0.8, 0.8]]])
    assert (scripted_policy("hungarian", scenario).choose(state, places) == -1).all()
    state = state._replace(load=np.array([[1, 0, 1, 1]], np.float32))
    chosen = scripted_policy("hungarian", scenario).choose(state, places)
    assert chosen.tolist() == [[0, -1, -1, 0]]
