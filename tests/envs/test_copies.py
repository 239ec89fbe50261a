"""Batches and views are pickled and deep-copied: a copy goes on as the original does."""

import copy
import multiprocessing
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from worlds import CROWDED, plan

from innerattn.config import Scenario
from innerattn.envs import BatchEnv, RescueEnv, RescueVectorEnv, env, parallel_env

FAULTY = Scenario.preset("mixed-faults").replace(episode_steps=9)


def in_another_process(method: str) -> Callable[[Any], Any]:
    """Sends an environment to a process of its own, which steps it once and sends it back."""

    def send(world: Any) -> Any:
        with multiprocessing.get_context(method).Pool(1) as pool:
            return pool.apply(copy.copy, (world,))

    return send


COPIES = {
    "pickle": lambda world: pickle.loads(pickle.dumps(world)),
    "deepcopy": copy.deepcopy,
    "spawn": in_another_process("spawn"),
    "forkserver": in_another_process("forkserver"),
}


@pytest.mark.parametrize(
    ("way", "autoreset"),
    [
        ("pickle", "same_step"),
        ("pickle", "next_step"),
        ("deepcopy", "disabled"),
        ("spawn", "same_step"),
        ("forkserver", "disabled"),
    ],
)
def test_a_batch_goes_on(way: str, autoreset: Any) -> None:
    made = BatchEnv(FAULTY, 7, 3, 2, autoreset=autoreset, copy=False, first_env=5)
    made.reset(seed=8)
    actions = plan(15, 7)
    for row in actions[:8]:
        made.step(row)
    other = COPIES[way](made)
    assert other.snapshot() == made.snapshot()
    assert (other.num_threads, other.scenario) == (made.num_threads, made.scenario)
    for row in actions[8:]:
        if autoreset == "disabled":
            over = made.step_counts() == FAULTY.episode_steps
            for env in (made, other):
                env.reset(mask=over)
        one, two = made.step(row), other.step(row)
        assert [part.tobytes() for part in one] == [part.tobytes() for part in two]
        assert not two.obs.flags.writeable
    assert other.reset(seed=1).tobytes() == made.reset(seed=1).tobytes()


GOING_ON = CROWDED.replace(end_when_rescued=None)
"""No episode of it ends within the steps taken here."""

VIEWS: dict[str, Callable[[], Any]] = {
    "single": lambda: RescueEnv(GOING_ON, seed=1),
    "made": lambda: gymnasium.make("innerattn/Rescue-v0", scenario=GOING_ON, form="agents"),
    "vector": lambda: RescueVectorEnv(3, GOING_ON, seed=1),
    "parallel": lambda: parallel_env(GOING_ON, seed=1, render_mode="rgb_array"),
    "in turn": lambda: env(GOING_ON, seed=1),
}


def seed_actions(world: Any) -> None:
    """Make the actions drawn from a world's own action spaces the same in every run."""
    if hasattr(world, "possible_agents"):
        for number, name in enumerate(world.possible_agents):
            world.action_space(name).seed(number)
    else:
        world.action_space.seed(0)


def act(world: Any, steps: int) -> Any:
    """Let a world act by its own action spaces; what it said last."""
    said = None
    for _ in range(steps):
        if hasattr(world, "agent_selection"):
            world.step(int(world.action_space(world.agent_selection).sample()))
            said = world.last()
        elif hasattr(world, "agents"):
            said = world.step({name: world.action_space(name).sample() for name in world.agents})
        else:
            said = world.step(world.action_space.sample())
    return said


@pytest.mark.parametrize("name", VIEWS)
@pytest.mark.parametrize("way", ["pickle", "deepcopy"])
def test_a_view_goes_on(name: str, way: str) -> None:
    made = VIEWS[name]()
    made.reset(seed=4)
    seed_actions(made)
    act(made, 4)
    other = COPIES[way](made)
    wanted, found = act(made, 9), act(other, 9)
    np.testing.assert_equal(found, wanted)
    states = [getattr(world, "unwrapped", world).state() for world in (made, other)]
    np.testing.assert_array_equal(*states)
    made.close()
    assert len(other.unwrapped.state()), "a copy has worlds of its own"
    other.close()


def test_a_closed_batch_is_not_copied() -> None:
    made = BatchEnv("mixed", 2)
    made.close()
    with pytest.raises(RuntimeError, match="closed"):
        pickle.dumps(made)


def test_gymnasiums_processes_step_it(tmp_path: Path) -> None:
    code = """
import functools
import gymnasium
import innerattn
import numpy as np

if __name__ == "__main__":
    make = functools.partial(gymnasium.make, "innerattn:innerattn/Rescue-v0", scenario="double")
    loop = gymnasium.vector.SyncVectorEnv([make] * 2)
    env = gymnasium.vector.AsyncVectorEnv([make] * 2, context="spawn")
    for one in (env, loop):
        one.reset(seed=3)
        one.action_space.seed(0)
    for _ in range(30):
        actions = env.action_space.sample()
        found, wanted = env.step(actions), loop.step(actions)
        assert all(map(np.array_equal, found[:4], wanted[:4]))
    env.close()
    print("equal")
"""
    (tmp_path / "program.py").write_text(code)
    command = [sys.executable, str(tmp_path / "program.py")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.stdout == "equal\n", done.stderr
