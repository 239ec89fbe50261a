"""Exported teams for tests, of the weights that training begins with."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch.onnx._internal.exporter._registration as registration
from fresh_run import make_run, run_config

from innerattn.envs import BatchEnv
from innerattn.envs.senses import ray_columns
from innerattn.envs.state import shares_left
from innerattn.policies import Exported
from innerattn.train.export import export_run

FRAMED = {
    "network.symmetry": "canonical",
    "network.parameter_sharing": "kind",
    "network.encoder": "entities",
    "network.hidden_width": 64,
    "network.attention_heads": 2,
}


# PyTorch gathers two thousand operators anew for each network that it writes: once will do.
registration.ONNXRegistry.from_torchlib = staticmethod(
    cache(registration.ONNXRegistry.from_torchlib)
)


def made_export(folder: Path, method: str, **values: object) -> tuple[Path, Path]:
    """The folders of a run and of its export."""
    run = make_run(folder / "run", run_config(method, **values))
    return run, export_run(run, folder / "export")[0]


def readings_of(team: Exported, robot: str, env: BatchEnv, world: int) -> dict[str, Any]:
    """What a robot with perfect links knows of a world, through the senses that it has there.

    Where robots tell each other of victims, their order must be that of the slots.
    """
    names = team.robot_names
    number, scenario = names.index(robot), env.scenario
    bodies = {name: _body(env, world, index) for index, name in enumerate(names)}
    own = bodies.pop(robot)
    own |= _own_senses(env, world, number)
    victims = _victims(team, env, world)
    found = {"own": own, "teammates": bodies, "victims": victims}
    if scenario.has_limited_sight:
        since = _since_seen(env, world, number)
        for index, name in enumerate(names):
            if name != robot and since[index] != 0.0:
                bodies[name] = _unseen(since[index])
        known = _known(env, world, number)
        for slot, time in enumerate(since[len(names) :]):
            if known[slot]:
                victims[slot]["since_seen"] = time
            else:
                victims[slot] = _unseen(time)
    if "teammate_0.heard" in env.observation_names():
        heard = env.heard()[world, number]
        found["heard"] = [name for name, one in zip(names, heard, strict=True) if one]
    return found


def _body(env: BatchEnv, world: int, robot: int) -> dict[str, Any]:
    scenario = env.scenario.robots[robot]
    found: dict[str, Any] = {
        "position": env.positions()[world, robot],
        "velocity": env.velocities()[world, robot].tolist(),
    }
    if scenario.has_wheels:
        found["heading"] = float(env.headings()[world, robot])
    if scenario.battery is not None:
        found["charge"] = float(env.charge()[world, robot])
    if scenario.load is not None:
        found["load"] = float(env.load()[world, robot])
    return found


def _own_senses(env: BatchEnv, world: int, robot: int) -> dict[str, Any]:
    scenario, found = env.scenario.robots[robot], {}
    if scenario.has_wheels:
        found["turn_rate"] = float(env.turn_rates()[world, robot])
    if scenario.range_sensor is not None:
        near = env.observe()[world, robot, ray_columns(env)][: scenario.range_sensor.rays]
        reach = scenario.range_sensor.range_m
        found["ranges"] = [(1.0 - float(one)) * reach if one > 0.0 else None for one in near]
    return found


def _victims(team: Exported, env: BatchEnv, world: int) -> list[Any]:
    tasks = [task.name for task in team.contract.tasks]
    scenario, table = env.scenario, env.victims()
    left = np.zeros(table.shape)
    if scenario.has_deadlines:
        left = shares_left(scenario, table, env.step_counts())
    victims: list[dict[str, object] | None] = []
    for one, share in zip(table[world], left[world], strict=True):
        victim = {"task": tasks[one["task"]], "position": (float(one["x"]), float(one["y"]))}
        victim |= {"served": float(one["served"])} if scenario.has_services else {}
        victim |= {"time_left": float(share)} if scenario.has_deadlines else {}
        victim |= {"blocked": float(one["blocked"])} if scenario.has_order else {}
        victims.append(victim if one["present"] else None)
    return victims


def _since_seen(env: BatchEnv, world: int, robot: int) -> list[float | None]:
    """Seconds since a robot last saw each robot and each slot's victim; None: never."""
    steps, now = env.last_seen()[world, robot], env.step_counts()[world]
    dt = np.float32(env.scenario.dt_s)
    return [None if step < 0 else float(np.float32(now - step) * dt) for step in steps]


def _unseen(time: float | None) -> dict[str, float] | None:
    return None if time is None else {"since_seen": time}


def _known(env: BatchEnv, world: int, robot: int) -> list[bool]:
    """Which slots' victims a robot sees now or is told of."""
    if env.scenario.victim_order == "relevant":
        since = _since_seen(env, world, robot)[env.num_robots :]
        return [bool(one) for one in env.victims()[world]["present"] & (np.array(since) == 0.0)]
    present = [f"victim_{slot}.present" for slot in range(env.victims().shape[1])]
    columns = [env.observation_names().index(name) for name in present]
    return [bool(one) for one in env.observe()[world, robot, columns]]
