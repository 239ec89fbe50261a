"""What each robot's own sensors give it: read off the world that stands for hardware."""

from __future__ import annotations

from typing import Any

import numpy as np

from innerattn.envs import BatchEnv
from innerattn.envs.senses import ray_columns
from innerattn.policies import Exported


def sensed(env: BatchEnv, team: Exported, robot: int) -> dict[str, Any]:
    """The readings of one robot, but for what its teammates tell it.

    Where sight is limited there is also ``unseen``: seconds since it last saw each teammate that it
    does not see now, None if never.
    """
    victims = _victims(env, team)
    found = {"own": _own(env, robot), "victims": victims}
    if env.scenario.has_limited_sight:
        count = len(team.robot_names)
        since = _since_seen(env, robot)
        for slot, time in enumerate(since[count:]):
            if time != 0.0:
                victims[slot] = None if time is None else {"since_seen": time}
        named = zip(team.robot_names, since[:count], strict=True)
        own = team.robot_names[robot]
        found["unseen"] = {name: time for name, time in named if time != 0.0 and name != own}
    return found


def _own(env: BatchEnv, robot: int) -> dict[str, Any]:
    body = env.scenario.robots[robot]
    found: dict[str, Any] = {
        "position": env.positions()[0, robot].tolist(),
        "velocity": env.velocities()[0, robot].tolist(),
        "available": bool(env.fault_state()["unavailable"][0, robot] < 1.0),
    }
    if body.has_wheels:
        found["heading"] = float(env.headings()[0, robot])
        found["turn_rate"] = float(env.turn_rates()[0, robot])
    if body.battery is not None:
        found["charge"] = float(env.charge()[0, robot])
    if body.load is not None:
        found["load"] = float(env.load()[0, robot])
    if body.range_sensor is not None:
        near = env.observe()[0, robot, ray_columns(env)][: body.range_sensor.rays]
        reach = body.range_sensor.range_m
        found["ranges"] = [(1.0 - float(one)) * reach if one > 0.0 else None for one in near]
    return found


def _victims(env: BatchEnv, team: Exported) -> list[dict[str, Any] | None]:
    tasks = [task.name for task in team.contract.tasks]
    return [
        {"task": tasks[one["task"]], "position": [float(one["x"]), float(one["y"])]}
        if one["present"]
        else None
        for one in env.victims()[0]
    ]


def _since_seen(env: BatchEnv, robot: int) -> list[float | None]:
    """Seconds since a robot last saw, or was told of, each robot and the victim of each slot."""
    steps, now = env.last_seen()[0, robot], env.step_counts()[0]
    dt = np.float32(env.scenario.dt_s)
    return [None if step < 0 else float(np.float32(now - step) * dt) for step in steps]
