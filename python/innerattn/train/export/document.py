"""The contract of an exported team: everything that a robot's program must know, in words too."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from importlib.metadata import version
from typing import Any

from innerattn.config import RunConfig
from innerattn.nn import EntityColumns
from innerattn.nn.actions import LOG_STD_RANGE, LOG_STD_SHIFT
from innerattn.policies.exported.contract import (
    FORMAT,
    VERSION,
    Entities,
    FrameColumns,
    LogStd,
    Network,
    digest_of,
)
from innerattn.train.columns import vector_columns

MAX_AGE_PERIODS = 3
"""How many control periods old a reading may be, if nothing else is asked for."""
LEAKY_RELU_SLOPE = 0.01

_FORCES = (
    ("stay", (0.0, 0.0)),
    ("+x", (1.0, 0.0)),
    ("-x", (-1.0, 0.0)),
    ("+y", (0.0, 1.0)),
    ("-y", (0.0, -1.0)),
)
PUSHES = [(int(x), int(y)) for _, (x, y) in _FORCES]
"""Direction of each action."""

_ABOUT = {
    "frames": "World frame: origin in the centre of the arena, x and y along its walls, metres. "
    "relative_* columns are differences in axes of the world frame; nothing is rotated with the "
    "robot's heading. The ONNX files take rows in this frame and give actions in it; a frame that "
    "the team was trained in is inside them.",
    "observation": "One float32 number for each column, in this order. own.* comes from the "
    "robot's own estimate of its pose and velocity. teammate_k.* comes from the last message of "
    "the k-th other robot in the order of `robots`, minus the robot's own position or velocity. "
    "victim_k.* comes from the list of victims that are waiting.",
    "victims": "With victim_order 'relevant': first the victims that need an ability of this "
    "robot, then the others; within each the nearer first. With 'slot': as in the list. Slots "
    "without a victim are zeros.",
    "not_heard": "All columns of a teammate that is not heard are zeros, its abilities and "
    "availability too. A message older than max_age_s counts as not heard.",
    "faults": "frozen_sensor: give the row of the step before once more. blackout: zeros, except "
    "own abilities, availability and faults. unavailable: the robot's own availability is 0 in "
    "its row and in its messages. Noise needs nothing: all relative columns use the robot's own "
    "estimate.",
    "action": "One action for each control period. Its force is held for the whole period. Without "
    "contact that is the velocity clip((1 - damping) v + force * drive_force_n / mass_kg * "
    "control_period_s, max_speed_mps), set at the start of the period, where v is the present "
    "velocity and clip shortens the vector.",
    "probabilities": "softmax of the logits. With greedy_actions the likeliest action is taken, "
    "else one is drawn.",
}
_ABOUT_FORCES = _ABOUT | {
    "action": "One force for each control period, as a share of full force along x and y. A vector "
    "longer than 1 is shortened to 1. It is held for the whole period. Without contact that is the "
    "velocity clip((1 - damping) v + force * drive_force_n / mass_kg * control_period_s, "
    "max_speed_mps), set at the start of the period, where v is the present velocity and clip "
    "shortens the vector.",
    "probabilities": "The output `policy` holds means x and y, then log standard deviations x and "
    "y, of a normal distribution. Its draws go through tanh on each axis. With greedy_actions the "
    "force is tanh of the means, the output `force`, else one is drawn.",
}


def contract_document(
    config: RunConfig,
    names: Sequence[str],
    network: Network,
    *,
    of_robot: Sequence[str],
    actors: Mapping[str, str],
    weights_sha256: str,
    run: Mapping[str, str | int | None],
    files: Mapping[str, bytes],
) -> dict[str, Any]:
    """The values of `innerattn.policies.exported.contract.Contract` as JSON, but for the check.

    Args:
        config: the run.
        names: of the columns of an observation.
        network: what numpy needs to know of the actors.
        of_robot: name of the actor of each robot.
        actors: the ONNX file of each actor.
        weights_sha256: digest of the tensors for numpy.
        run: where the team comes from.
        files: the bytes of each file beside the contract.
    """
    scenario = config.scenario
    continuous = scenario.actions == "continuous"
    parts = asdict(network)
    if network.log_std is None:
        del parts["log_std"]  # so that earlier versions read the contract
    kind = {"action_kind": scenario.actions} if continuous else {}
    forces = () if continuous else _FORCES
    worlds = scenario.model_dump(mode="json")
    return _plain(
        {
            "format": FORMAT,
            "version": VERSION,
            "about": _ABOUT_FORCES if continuous else _ABOUT,
            "made_with": {
                name: version(name) for name in ("innerattn", "torch", "onnx", "onnxscript")
            },
            "run": dict(run),
            "scenario": worlds,
            "scenario_sha256": digest_of(worlds),
            "control_period_s": scenario.dt_s,
            "damping": scenario.damping,
            "arena_half_width_m": scenario.arena_half_width_m,
            "victim_order": scenario.victim_order,
            "victim_slots": scenario.num_victims,
            "observe_faults": scenario.observe_faults,
            "max_age_s": round(MAX_AGE_PERIODS * scenario.dt_s, 9),
            "greedy_actions": config.evaluate.greedy_actions,
            "abilities": _abilities(names),
            "tasks": [{"name": task.name, "needs": task.needs} for task in scenario.tasks],
            "robots": [
                {
                    "name": robot.name,
                    "kind": robot.kind,
                    "abilities": robot.abilities,
                    "max_speed_mps": robot.max_speed_mps,
                    "mass_kg": robot.mass_kg,
                    "radius_m": robot.radius_m,
                    "drive_force_n": robot.drive_force_n,
                    "actor": actor,
                }
                for robot, actor in zip(scenario.robots, of_robot, strict=True)
            ],
            "observation": [_column(name) for name in names],
            "actions": [
                {"number": number, "name": name, "force": force}
                for number, (name, force) in enumerate(forces)
            ],
            "network": parts,
            "actors": dict(actors),
            "weights_sha256": weights_sha256,
            "files": {
                name: {"sha256": sha256(data).hexdigest(), "bytes": len(data)}
                for name, data in files.items()
            },
            "checked": None,
            **kind,
        }
    )


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values as JSON has them."""
    found: dict[str, Any] = json.loads(json.dumps(values, allow_nan=False))
    return found


def network_of(config: RunConfig, names: Sequence[str], entities: EntityColumns | None) -> Network:
    """What numpy needs to know of the actors."""
    frame = None
    if config.network.symmetry == "canonical":
        found = vector_columns(names)
        frame = FrameColumns(found.vectors, found.handed, found.anchors)
    return Network(
        encoder=config.network.encoder,
        hidden_width=config.network.hidden_width,
        leaky_relu_slope=LEAKY_RELU_SLOPE,
        entities=None if entities is None else Entities(**asdict(entities)),
        frame=frame,
        log_std=_log_std() if config.scenario.actions == "continuous" else None,
    )


def _log_std() -> LogStd:
    low, high = LOG_STD_RANGE
    return LogStd(low, high, LOG_STD_SHIFT)


def _abilities(names: Sequence[str]) -> list[str]:
    """All abilities, in the order of columns."""
    prefix = "own.ability."
    return [name.removeprefix(prefix) for name in names if name.startswith(prefix)]


_SOURCES = {
    "own": "the robot's own state",
    "teammate": "the teammate's last message",
    "victim": "the list of victims",
}


def _column(name: str) -> dict[str, str]:
    owner, _, quantity = name.partition(".")
    unit, frame = "1", "none"
    first = quantity.split(".")[0]
    if first in ("position", "velocity"):
        unit, frame = ("m", "world") if first == "position" else ("m/s", "world")
    elif first in ("relative_position", "relative_velocity"):
        unit = "m" if first == "relative_position" else "m/s"
        frame = "world axes, relative to the robot"
    elif first == "fault":
        kinds = {"heading_bias": "rad", "position_noise": "m", "velocity_noise": "m/s"}
        unit = kinds.get(quantity.split(".")[1], "1")
    return {
        "name": name,
        "unit": unit,
        "frame": frame,
        "source": _SOURCES[owner.split("_")[0]],
    }
