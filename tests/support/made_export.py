"""Exported teams for tests, of the weights that training begins with."""

from functools import cache
from pathlib import Path

import numpy as np
import torch.onnx._internal.exporter._registration as registration
from fresh_run import make_run, run_config

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


def readings_of(team: Exported, robot: str, env: object, world: int) -> dict[str, object]:
    """What a robot with perfect senses and links knows of a world."""
    positions, velocities = env.positions()[world], env.velocities()[world]  # type: ignore[attr-defined]
    bodies = {
        name: {"position": positions[i], "velocity": velocities[i].tolist()}
        for i, name in enumerate(team.robot_names)
    }
    tasks = [task.name for task in team.contract.tasks]
    scenario, table = env.scenario, env.victims()  # type: ignore[attr-defined]
    left = np.zeros(table.shape)
    if scenario.has_deadlines:
        left = shares_left(scenario, table, env.step_counts())  # type: ignore[attr-defined]
    victims: list[dict[str, object] | None] = []
    for one, share in zip(table[world], left[world], strict=True):
        victim = {"task": tasks[one["task"]], "position": (float(one["x"]), float(one["y"]))}
        victim |= {"served": float(one["served"])} if scenario.has_services else {}
        victim |= {"time_left": float(share)} if scenario.has_deadlines else {}
        victim |= {"blocked": float(one["blocked"])} if scenario.has_order else {}
        victims.append(victim if one["present"] else None)
    own = bodies.pop(robot)
    return {"own": own, "teammates": bodies, "victims": victims}
