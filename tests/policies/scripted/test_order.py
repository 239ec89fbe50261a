"""Scripts in worlds whose tasks have an order: nobody leaves work that can be done to wait."""

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.policies.scripted.dispatch import GreedyPolicy, HungarianPolicy

BOTH = pytest.mark.parametrize("kind", [GreedyPolicy, HungarianPolicy])
HEALTHY = BatchEnv("mixed", 1).fault_state()
VICTIM = np.dtype(
    [("present", "?"), ("task", "i8"), ("x", "f4"), ("y", "f4"), ("blocked", "?")],
)


def ordered(situation: str = "double", **others: object) -> Scenario:
    plain = Scenario.preset(situation)
    tasks = (plain.tasks[0], plain.tasks[1].replace(after=("task_1",)))
    return plain.replace(**{"tasks": tasks, **others})


def chosen(policy: GreedyPolicy | HungarianPolicy, positions: list, victims: list) -> list[int]:
    """The slots that the robots of one world at rest go to; victims are rows of `VICTIM`."""
    table = np.array([tuple(victim) for victim in victims], VICTIM)[None]
    places = np.asarray([positions], np.float32)
    state = WorldState(places, np.zeros_like(places), table, HEALTHY, np.zeros(1, int))
    at = np.stack([table["x"], table["y"]], -1).astype(np.float64)
    return policy.choose(state, at)[0].tolist()


@BOTH
@pytest.mark.parametrize("blocked", [False, True])
def test_robots_go_first_to_victims_that_do_not_wait(
    kind: type[GreedyPolicy] | type[HungarianPolicy], blocked: bool
) -> None:
    # Both food robots are near the second victim, and far from the first one.
    positions = [(0.7, 0.1), (0.75, 0.0), (0.7, -0.1), (-0.9, 0.0)]
    victims = [(True, 0, -0.8, 0.0, False), (True, 1, 0.8, 0.0, blocked)]
    found = chosen(kind(ordered()), positions, victims)
    assert found[2:] == [1, 0]  # who can do nothing else moves near
    if kind is GreedyPolicy:
        assert found[:2] == ([0, 0] if blocked else [1, 1])
    else:
        assert sorted(found[:2]) == [0, 1]


@BOTH
def test_a_victim_that_waits_alone_is_waited_for(
    kind: type[GreedyPolicy] | type[HungarianPolicy],
) -> None:
    positions = [(0.7, 0.1), (-0.75, 0.0), (0.7, -0.1), (-0.9, 0.0)]
    victims = [(False, 0, 0.0, 0.0, False), (True, 1, 0.8, 0.0, True)]
    found = chosen(kind(ordered()), positions, victims)
    assert found[0] == found[2] == 1
    assert found[3] == -1


def test_one_robot_for_two_needs_goes_where_nobody_waits() -> None:
    """Sooner at the one that waits, it still goes to the other one."""
    worlds = ordered()
    team = (worlds.robots[0], *worlds.robots[2:])
    one = worlds.replace(robots=team)
    table = np.array([(True, 0, -0.8, 0.0, False), (True, 1, 0.8, 0.0, True)], VICTIM)[None]
    places = np.array([[(0.7, 0.0), (0.8, 0.1), (-0.8, 0.1)]], np.float32)
    faults = BatchEnv(one, 1).fault_state()
    state = WorldState(places, np.zeros_like(places), table, faults, np.zeros(1, int))
    at = np.stack([table["x"], table["y"]], -1).astype(np.float64)
    assert HungarianPolicy(one).choose(state, at)[0].tolist() == [0, 1, 0]
    table["blocked"] = False
    assert HungarianPolicy(one).choose(state, at)[0].tolist() == [1, 1, 0]


@pytest.mark.parametrize("name", ["greedy", "hungarian", "oracle"])
@pytest.mark.parametrize("sums", [False, True])
@pytest.mark.parametrize("situation", ["double", "mixed"])
def test_scripts_rescue_in_the_order(name: str, sums: bool, situation: str) -> None:
    worlds = ordered(situation)
    if sums:
        needs = {"food": 1.5, "medicine": 0.5}
        worlds = worlds.replace(tasks=(worlds.tasks[0].replace(needs=needs), worlds.tasks[1]))
    policy = scripted_policy(name, worlds)
    env = BatchEnv(worlds, 60, seed=5, num_threads=1)
    obs, rescued = env.reset(), [0, 0]
    for _ in range(60):
        before = env.victims()
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        obs = step.obs
        for row in step.rescues:
            victim = before[row["env"], row["slot"]]
            others = before[row["env"]]
            first = others[others["present"] & (others["task"] == 0)]
            blocks = (first["appeared_step"] <= victim["appeared_step"]).any()
            assert not (victim["task"] == 1 and blocks)
            rescued[row["task"]] += 1
    assert min(rescued) > 40, rescued
