"""Scripts in worlds where victims arrive at random: sometimes nobody is there."""

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy

PLAIN = Scenario.preset("mixed")


def worlds(rate: float, sums: bool, timed: bool) -> Scenario:
    tasks = [task.replace(arrival_rate_hz=rate) for task in PLAIN.tasks]
    if sums:
        tasks[0] = tasks[0].replace(needs={"food": 1.5, "medicine": 0.5})
    if timed:
        tasks[1] = tasks[1].replace(deadline_s=(1.0, 4.0), service_s=0.2, after=("task_1",))
    return PLAIN.replace(situation="poisson", tasks=tuple(tasks), max_victims=3, episode_steps=60)


@pytest.mark.parametrize("name", ["random", "greedy", "hungarian", "oracle"])
@pytest.mark.parametrize("sums", [False, True])
@pytest.mark.parametrize("timed", [False, True])
def test_scripts_act_with_and_without_victims(name: str, sums: bool, timed: bool) -> None:
    scenario = worlds(0.3, sums, timed)
    policy = scripted_policy(name, scenario)
    env = BatchEnv(scenario, 40, seed=5, num_threads=1)
    obs, rescued, empty = env.reset(), 0, 0
    for _ in range(60):
        empty += int((~env.victims()["present"].any(1)).sum())
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        obs = step.obs
        rescued += len(step.rescues)
    assert empty > 200
    assert rescued > (50 if name != "random" else -1), rescued


def test_robots_without_a_victim_go_to_the_centre() -> None:
    scenario = worlds(0.0, False, False)
    for name in ("greedy", "hungarian"):
        policy = scripted_policy(name, scenario)
        env = BatchEnv(scenario, 8, seed=1, num_threads=1)
        obs = env.reset()
        before = np.linalg.norm(env.positions(), axis=-1).mean()
        for _ in range(20):
            obs = env.step(policy.act(PolicyInput(obs, WorldState.of(env)))).obs
        assert np.linalg.norm(env.positions(), axis=-1).mean() < 0.5 * before
