"""Scripts in worlds with batteries: robots come back to a station before they are empty."""

import numpy as np
import pytest
import scripted_play

from innerattn.config import Battery, Scenario, Station
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy

SCRIPTS = pytest.mark.parametrize("name", ["greedy", "hungarian", "planner", "oracle"])


def powered(stations: int = 2, capacity_j: float = 12.0, **changed: object) -> Scenario:
    battery = Battery(capacity_j=capacity_j, per_m_j=2.0, idle_w=1.0)
    places = ((-0.6, -0.6), (0.6, 0.6))[:stations]
    return Scenario().replace(
        robots=tuple(robot.replace(battery=battery) for robot in Scenario().robots),
        stations=tuple(Station(position_m=at, radius_m=0.35, recharge_w=20.0) for at in places),
        **{"episode_steps": 300, "engine": "discs", **changed},
    )


def played(name: str, scenario: Scenario) -> tuple[int, float]:
    """Rescues in an episode of each world, and the share of steps that a charge was used up."""
    return scripted_play.played(name, scenario, BatchEnv.charge)


@SCRIPTS
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_robots_that_charge_go_on_with_rescues(name: str, actions: str) -> None:
    rescues, empty = played(name, powered(actions=actions))
    alone, empty_alone = played(name, powered(stations=0, actions=actions))
    assert empty < 0.02
    assert empty_alone > 0.3
    assert rescues > 2 * alone


@SCRIPTS
def test_batteries_that_last_change_nothing(name: str) -> None:
    lasting = powered(stations=0, capacity_j=1e6, episode_steps=50)
    plain = lasting.replace(robots=Scenario().robots)
    assert played(name, lasting) == (played(name, plain)[0], 0.0)


@SCRIPTS
def test_one_robot_with_a_battery_gives_all_of_a_sum(name: str) -> None:
    both = {"water": 1.0, "rope": 1.0}
    robot = Scenario().robots[0].replace(abilities=both)
    lasting = powered(stations=0).replace(
        robots=(robot.replace(battery=Battery(capacity_j=1e6, per_m_j=1.0)),),
        tasks=({"name": "flood", "needs": both},),
        situation="single",
    )
    rescues, _ = played(name, lasting)
    assert rescues == played(name, lasting.replace(robots=(robot,)))[0] > 100


@SCRIPTS
def test_who_has_too_little_for_the_way_back_goes_to_charge(name: str) -> None:
    scenario = powered(stations=1, capacity_j=20.0, situation="single")
    env = BatchEnv(scenario, 1, seed=2, num_threads=1)
    env.reset()
    victims = env.victims()
    victims["task"], victims["x"], victims["y"] = 0, 0.8, 0.8
    env.set_victims(victims)
    env.set_motion(np.zeros((1, 4, 2)) + np.arange(4)[:, None] * 0.11, np.zeros((1, 4, 2)))
    policy = scripted_policy(name, scenario)
    state = WorldState.of(env)
    places = np.stack([state.victims["x"], state.victims["y"]], -1).astype(float)
    for share, goes in ((1.0, True), (0.3, False), (0.0, False)):
        now = state._replace(charge=np.full((1, 4), share, np.float32))
        chosen = policy.choose(now, places)[0]
        assert (chosen[[0, 1, 3]] >= 0).any() == goes
        if not goes:  # towards the station: -x or -y
            actions = policy.act(PolicyInput(env.observe(), now))[0]
            assert np.isin(actions, [2, 4]).all()


@pytest.mark.parametrize("name", ["hungarian", "planner", "oracle"])
def test_a_battery_for_one_farther_victim_at_a_time_is_enough(name: str) -> None:
    medic, food = Scenario().robots[3], Scenario().robots[0]
    scenario = Scenario().replace(
        robots=(medic.replace(battery=Battery(capacity_j=80.0, per_m_j=10.0, idle_w=1.0)), food),
        tasks=(Scenario().tasks[0].replace(needs=(food.abilities[0], medic.abilities[0])),),
        stations=(Station(position_m=(-0.8, 0.0), recharge_w=20.0),),
        episode_steps=300,
    )
    early, _ = played(name, scenario.replace(episode_steps=150))
    whole, empty = played(name, scenario)
    assert empty == 0.0
    assert whole > 1.6 * early, "the team does not come to a standstill"
