"""Where readings of range sensors stand in an observation."""

from __future__ import annotations

from innerattn.envs.batch import BatchEnv


def ray_columns(env: BatchEnv) -> list[int]:
    """Columns of an observation with the readings of the robot's own rays, in their order."""
    names = env.observation_names()
    return [column for column, name in enumerate(names) if name.startswith("own.ray.")]
