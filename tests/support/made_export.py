"""Exported teams for tests, of the weights that training begins with."""

from pathlib import Path

from fresh_run import make_run, run_config

from innerattn.policies import Exported
from innerattn.train.export import export_run

FRAMED = {
    "network.symmetry": "canonical",
    "network.parameter_sharing": "kind",
    "network.encoder": "entities",
    "network.hidden_width": 64,
    "network.attention_heads": 2,
}


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
    victims = [
        {"task": tasks[one["task"]], "position": (float(one["x"]), float(one["y"]))}
        if one["present"]
        else None
        for one in env.victims()[world]  # type: ignore[attr-defined]
    ]
    own = bodies.pop(robot)
    return {"own": own, "teammates": bodies, "victims": victims}
