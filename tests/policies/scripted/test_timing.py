"""Scripts in worlds whose victims take time: they stay, and go nowhere in vain."""

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.policies.scripted.dispatch import GreedyPolicy, HungarianPolicy

BOTH = pytest.mark.parametrize("kind", [GreedyPolicy, HungarianPolicy])
HEALTHY = BatchEnv("mixed", 1).fault_state()
VICTIM = np.dtype(
    [
        *(("present", "?"), ("task", "i8"), ("x", "f4"), ("y", "f4")),
        *(("served", "f4"), ("deadline_step", "i8")),
    ]
)


def scenario(situation: str = "double", **times: object) -> Scenario:
    plain = Scenario.preset(situation)
    return plain.replace(tasks=tuple(task.replace(**times) for task in plain.tasks))


def chosen(
    policy: GreedyPolicy | HungarianPolicy, positions: list, victims: list, step: int = 0
) -> list[int]:
    """The slots that the robots of one world at rest go to; victims are rows of `VICTIM`."""
    table = np.array([tuple(victim) for victim in victims], VICTIM)[None]
    places = np.asarray([positions], np.float32)
    state = WorldState(places, np.zeros_like(places), table, HEALTHY, np.array([step]))
    at = np.stack([table["x"], table["y"]], -1).astype(np.float64)
    return policy.choose(state, at)[0].tolist()


@BOTH
def test_a_helper_stays_with_a_victim_whose_service_has_begun(
    kind: type[GreedyPolicy] | type[HungarianPolicy],
) -> None:
    # food_0 and medical_0 are at the first victim; the second one is nearer to food_0.
    policy = kind(scenario(service_s=1.0, deadline_s=100.0))
    positions = [(0.1, 0.0), (-0.9, -0.9), (0.2, 0.05), (-0.1, 0.0)]
    for served, wanted in ((0.0, 1), (0.3, 0)):
        victims = [(True, 0, 0.0, 0.0, served, 1000), (True, 1, 0.15, 0.0, 0.0, 1000)]
        found = chosen(policy, positions, victims)
        assert found[3] == 0
        if kind is GreedyPolicy or served:
            assert found[0] == wanted


@BOTH
@pytest.mark.parametrize(("deadline", "goes"), [(8, False), (9, False), (40, True), (-1, True)])
def test_nobody_goes_to_a_victim_that_cannot_be_rescued_in_time(
    kind: type[GreedyPolicy] | type[HungarianPolicy], deadline: int, goes: bool
) -> None:
    # The medic is 1.5 m away and needs about a second; the food robots are near.
    policy = kind(scenario(service_s=0.3, deadline_s=100.0))
    positions = [(-0.6, 0.0), (-0.7, 0.0), (0.9, 0.9), (0.9, 0.0)]
    victims = [(True, 0, -0.8, 0.0, 0.0, deadline), (False, 0, 0, 0, 0, -1)]
    found = chosen(policy, positions, victims)
    assert (found[3] == 0) == goes
    assert (0 in found[:2]) == goes
    later = chosen(policy, positions, [(True, 0, -0.8, 0.0, 0.0, 140), victims[1]], step=100)
    assert 0 in later[:2]
    assert chosen(policy, positions, [(True, 0, -0.8, 0.0, 0.0, 107), victims[1]], 100)[3] == -1


@pytest.mark.parametrize("name", ["greedy", "hungarian", "oracle"])
def test_begun_services_are_ended(name: str) -> None:
    """Once a service has begun nobody leaves: the victim is rescued, or its deadline passes."""
    worlds = scenario("double", service_s=0.5, deadline_s=5.0).replace(episode_steps=60)
    policy = scripted_policy(name, worlds)
    env = BatchEnv(worlds, 40, seed=3, num_threads=1, autoreset="disabled")
    obs = env.reset()
    begun = stopped = 0
    for _ in range(60):
        before = env.victims()
        obs = env.step(policy.act(PolicyInput(obs, WorldState.of(env)))).obs
        after = env.victims()
        same = (before["id"] == after["id"]) & (before["served"] > 0)
        begun += int((before["served"] > 0).sum())
        stopped += int((same & (after["served"] == before["served"])).sum())
    assert begun > 400
    assert stopped < 0.05 * begun, (begun, stopped)


def test_deadlines_that_nobody_can_keep_leave_the_team_in_the_middle() -> None:
    worlds = scenario("double", service_s=2.0, deadline_s=2.0).replace(episode_steps=40)
    for name in ("greedy", "hungarian"):
        policy = scripted_policy(name, worlds)
        record = run_episodes(policy, worlds, 8, 1, record=("positions",))
        assert len(record.rescues) == 0
        assert len(record.lost) > 8
        assert np.abs(record.steps["positions"][:, -1]).max() < 0.35
