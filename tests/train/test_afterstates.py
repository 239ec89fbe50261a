"""Worlds in which victims have just appeared, against what the victims' numbers say."""

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.train.afterstates import afterstates


@pytest.mark.parametrize("situation", ["single", "double", "mixed"])
def test_against_the_victims_of_before(situation: str) -> None:
    scenario = Scenario.preset(situation).replace(episode_steps=15)
    env = BatchEnv(scenario, 40, seed=1, num_threads=1)
    policy = scripted_policy("hungarian", scenario)
    obs, names = env.reset(), env.state_names()
    found = ends = rescues = 0
    for _ in range(40):
        before = [{v["id"] for v in row if v["present"]} for row in env.victims()]
        step = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        worlds, states = afterstates(env, ~step.truncated)
        assert states.dtype == np.float32
        expected = []
        for world in range(40):
            if step.truncated[world]:
                ends += 1
                continue
            row = env.state()[world]
            victims = env.victims()[world]
            new = [
                slot
                for slot, victim in enumerate(victims)
                if victim["present"] and victim["id"] not in before[world]
            ]
            for slot in new:
                columns = [k for k, name in enumerate(names) if name.startswith(f"victim_{slot}.")]
                assert row[columns].any()
                row[columns] = 0.0
            if new:
                expected.append((world, row))
        assert worlds.tolist() == [world for world, _ in expected]
        np.testing.assert_array_equal(states, np.reshape([r for _, r in expected], states.shape))
        found += len(worlds)
        rescues += len(step.rescues)
        obs = step.obs
    assert 100 < found <= rescues
    assert ends == 80
