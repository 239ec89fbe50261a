"""Small worlds, plans and byte images that the tests of the batch share."""

import numpy as np

from innerattn.config import Obstacle, Scenario
from innerattn.envs import BatchEnv, Step

CROWDED = Scenario(
    obstacles=(
        Obstacle(shape="disc", radius_m=0.08),
        Obstacle(shape="box", half_extents_m=(0.1, 0.05), position_m=(0.4, 0.4)),
    ),
    arena_half_width_m=0.6,
    rescue_radius_m=0.5,
    episode_steps=40,
    end_when_rescued=4,
)
"""Small, so that robots touch, rescue, and episodes end both ways."""

CONTINUOUS = Scenario(actions="continuous")


def batch(num_envs: int = 3, scenario: Scenario = CROWDED, **options: object) -> BatchEnv:
    env = BatchEnv(scenario, num_envs, **{"seed": 5, "num_threads": 1} | options)
    env.reset()
    return env


def plan(steps: int, num_envs: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 5, (steps, num_envs, 4))


def image(step: Step, env: BatchEnv, world: slice = slice(None), shift: int = 0) -> bytes:
    """The bytes of everything a step said of some worlds."""
    parts = [part[world].tobytes() for part in step[:5]]
    parts += [env.positions()[world].tobytes(), env.velocities()[world].tobytes()]
    parts += [env.victims()[world].tobytes(), env.reward_components()[world].tobytes()]
    chosen = np.isin(step.rescues["env"], np.arange(env.num_envs)[world])
    rescues = step.rescues[chosen].copy()
    rescues["env"] += shift
    return b"|".join([*parts, rescues.tobytes()])
