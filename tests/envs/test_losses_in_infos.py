"""Lost victims, and those turned away, in infos of gymnasium's views, against `BatchEnv`."""

from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, RescueEnv, RescueVectorEnv

PLAIN = Scenario.preset("double").replace(episode_steps=10)
MORTAL = PLAIN.replace(tasks=tuple(task.replace(deadline_s=(0.2, 0.6)) for task in PLAIN.tasks))

ARRIVING = Scenario.preset("mixed").replace(
    situation="poisson",
    max_victims=1,
    tasks=tuple(task.replace(arrival_rate_hz=6.0) for task in PLAIN.tasks),
    episode_steps=10,
)


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
    assert not {"lost", "turned_away"} & endless.step(np.zeros(4, np.int64))[-1].keys()


def test_who_is_turned_away_from_one_world() -> None:
    env, batch = RescueEnv(ARRIVING, seed=6), BatchEnv(ARRIVING, 1, 6, autoreset="disabled")
    env.reset()
    batch.reset()
    turned_away = 0
    for _ in range(10):
        *_, info = env.step(np.zeros(4, np.int64))
        batch.step(np.zeros((1, 4), np.int64))
        assert info["turned_away"] == batch.turned_away()[0]
        turned_away += info["turned_away"]
    assert turned_away > 2


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize(("worlds", "what"), [(MORTAL, "lost"), (ARRIVING, "turned_away")])
def test_of_many_worlds(mode: AutoresetMode, worlds: Scenario, what: str) -> None:
    found = []
    for make in (
        lambda: RescueVectorEnv(3, worlds, autoreset_mode=mode),
        lambda: gymnasium.vector.SyncVectorEnv(
            [partial(RescueEnv, worlds, first_env=world) for world in range(3)],
            autoreset_mode=mode,
        ),
    ):
        env = make()
        env.reset(seed=[1, 2, 3])
        seen = []
        for _ in range(10):
            *_, infos = env.step(np.zeros((3, 4), np.int64))
            last = infos.get("final_info", {})
            seen.append((np.zeros(3, int) + infos.get(what, 0) + last.get(what, 0)).tolist())
        found.append(seen)
    assert found[0] == found[1]
    assert np.sum(found[0]) > 6
