"""What all examples share: their options, and how a trained team is scored.

Every team meets the same worlds, those of `SEED`, for `EPISODES` episodes of 25 steps.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState, scripted_policy

EPISODES, SEED, EPISODE_STEPS = 500, 98_765, 25
Actor = Callable[[NDArray[np.float32]], Any]
"""Observations (E, R, D) float32 become actions (E, R) integers."""


class Spent(NamedTuple):
    """What a training took."""

    seconds: float
    """By the clock on the wall [s]."""
    cpu_seconds: float
    """Of all threads of this process [s]; it varies less where others use the machine, too."""


class Stopwatch:
    """Measures a training from when it is made."""

    def __init__(self) -> None:
        self._began = Spent(time.perf_counter(), time.process_time())

    def stop(self) -> Spent:
        """What was spent until now."""
        now = (time.perf_counter(), time.process_time())
        return Spent(*(end - begin for begin, end in zip(self._began, now, strict=True)))


def options(
    about: str | None, env_steps: int, arguments: Sequence[str] | None = None, **more: Any
) -> argparse.Namespace:
    """What the command line says: ``env_steps``, ``situation``, ``seed`` and ``more``.

    Args:
        about: what the program does.
        env_steps: how long it trains by default [control steps, counted in each world].
        arguments: the command line; none: that of the program.
        more: further options by name, with what `add_argument` takes.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--env-steps", type=int, default=env_steps, help="of all worlds together")
    parser.add_argument("--situation", default="mixed", help="name of a scenario preset")
    parser.add_argument("--seed", type=int, default=0)
    for name, settings in more.items():
        parser.add_argument(f"--{name.replace('_', '-')}", **settings)
    return parser.parse_args(arguments)


def rescues(scenario: Scenario, actor: Actor) -> float:
    """Mean rescues of a team in an episode."""
    return _play(scenario, lambda env, obs: actor(obs))  # noqa: ARG005


def scripted(scenario: Scenario, name: str) -> float:
    """Mean rescues of a script in an episode: "random" or "hungarian"."""
    policy = scripted_policy(name, scenario)
    policy.reset(SEED)
    return _play(scenario, lambda env, obs: policy.act(PolicyInput(obs, WorldState.of(env))))


def report(
    library: str, algorithm: str, given: argparse.Namespace, env_steps: int, spent: Spent,
    actor: Actor,
) -> dict[str, Any]:  # fmt: skip
    """Score a team and print the result as one line of JSON.

    Args:
        library: what trained the team.
        algorithm: by which algorithm.
        given: the options of the program.
        env_steps: how long it trained [control steps of all worlds].
        spent: what that took.
        actor: the team, greedy.

    Returns:
        What was printed. ``score`` is 0 for random play and 1 for hungarian dispatch.
    """
    scenario = Scenario.preset(given.situation)
    found = rescues(scenario, actor)
    low, high = scripted(scenario, "random"), scripted(scenario, "hungarian")
    result = {
        "library": library,
        "algorithm": algorithm,
        "situation": given.situation,
        "seed": given.seed,
        "env_steps": env_steps,
        "train_seconds": round(spent.seconds, 1),
        "train_cpu_seconds": round(spent.cpu_seconds, 1),
        "rescues_per_episode": round(found, 3),
        "score": round((found - low) / (high - low), 3),
    }
    print(json.dumps(result), flush=True)
    return result


def _play(scenario: Scenario, act: Callable[[BatchEnv, NDArray[np.float32]], Any]) -> float:
    """Mean rescues in the first episode of each world."""
    scenario = scenario.replace(episode_steps=EPISODE_STEPS)
    with closing(BatchEnv(scenario, EPISODES, seed=SEED)) as env:
        obs, count = env.reset(), 0
        running = np.ones(EPISODES, bool)
        while running.any():
            step = env.step(np.asarray(act(env, obs)))
            count += int(running[step.rescues["env"]].sum())
            running &= ~(step.terminated | step.truncated)
            obs = step.obs
    return count / EPISODES
