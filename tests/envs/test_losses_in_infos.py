"""Losses in the infos of gymnasium's views, against `BatchEnv.lost`."""

from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, RescueEnv, RescueVectorEnv

PLAIN = Scenario.preset("double").replace(episode_steps=10)
MORTAL = PLAIN.replace(tasks=tuple(task.replace(deadline_s=(0.2, 0.6)) for task in PLAIN.tasks))


def test_of_one_world() -> None:
    env, batch = RescueEnv(MORTAL, seed=4), BatchEnv(MORTAL, 1, 4, autoreset="disabled")
    env.reset()
    batch.reset()
    lost = 0
    for _ in range(10):
        *_, info = env.step(np.zeros(4, np.int64))
        batch.step(np.zeros((1, 4), np.int64))
        assert info["lost"] == len(batch.lost())
        lost += info["lost"]
    assert lost > 2
    endless = RescueEnv(PLAIN)
    endless.reset()
    assert "lost" not in endless.step(np.zeros(4, np.int64))[-1]


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_of_many_worlds(mode: AutoresetMode) -> None:
    found = []
    for make in (
        lambda: RescueVectorEnv(3, MORTAL, autoreset_mode=mode),
        lambda: gymnasium.vector.SyncVectorEnv(
            [partial(RescueEnv, MORTAL, first_env=world) for world in range(3)],
            autoreset_mode=mode,
        ),
    ):
        env = make()
        env.reset(seed=[1, 2, 3])
        seen = []
        for _ in range(10):
            *_, infos = env.step(np.zeros((3, 4), np.int64))
            last = infos.get("final_info", {})
            lost = np.zeros(3, int) + infos.get("lost", 0) + last.get("lost", 0)
            seen.append(lost.tolist())
        found.append(seen)
    assert found[0] == found[1]
    assert np.sum(found[0]) > 6
