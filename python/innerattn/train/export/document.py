"""The contract of an exported team: everything that a robot's program must know, in words too."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from hashlib import sha256
from importlib.metadata import version
from typing import Any

from innerattn.config import Robot, RunConfig, Scenario
from innerattn.config.team import TeamConfig
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
from innerattn.policies.exported.frame import Frame
from innerattn.policies.plain_team import pair_network
from innerattn.train.export.about import about
from innerattn.train.frames import turning_columns

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
_PUSHES = [(int(x), int(y)) for _, (x, y) in _FORCES]
_WAYS = ("stop", "forward", "backward", "left", "right")
_WHEELS = ((0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0))
"""What the actions of a differential drive set of its left and right wheel."""


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
        actors: the file of each actor, as of `Contract`.
        weights_sha256: digest of the tensors for numpy.
        run: where the team comes from.
        files: the bytes of each file beside the contract.
    """
    scenario = config.scenario
    continuous = scenario.actions == "continuous"
    parts = asdict(network)
    # What is not in use is left out, so that earlier versions read the contract.
    if network.log_std is None:
        del parts["log_std"]
    if network.pooling == "attention":
        del parts["pooling"]
    if network.pairs is None:
        del parts["pairs"]
    if network.entities is not None:
        known = parts["entities"]
        parts["entities"] = {key: one for key, one in known.items() if one is not None}
    if network.frame is not None and not network.frame.rays:
        del parts["frame"]["rays"], parts["frame"]["ray_turns"]
    kind = {"action_kind": scenario.actions} if continuous else {}
    forces = () if continuous else _FORCES
    has_onnx = any(name.endswith(".onnx") for name in files)
    libraries = ["innerattn", "torch", *(("onnx", "onnxscript") if has_onnx else ())]
    worlds = scenario.model_dump(mode="json")
    return _plain(
        {
            "format": FORMAT,
            "version": VERSION,
            "about": about(scenario, for_any_team=network.pairs is not None),
            "made_with": {name: version(name) for name in libraries},
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
                    **_body_of(robot, continuous),
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
            **_spots_of(scenario),
        }
    )


def _body_of(robot: Robot, continuous: bool) -> dict[str, Any]:
    """What a contract says of a robot that does more than push and see everything."""
    found: dict[str, Any] = {}
    if robot.drive != "force":
        found["drive"] = robot.drive
    if robot.has_wheels:
        shares = _WHEELS if robot.drive == "differential" else _PUSHES
        actions = () if continuous else zip(_WAYS, shares, strict=True)
        found["actions"] = [
            {"number": number, "name": name, "force": share}
            for number, (name, share) in enumerate(actions)
        ]
        found["max_turn_rad_s"] = robot.max_turn_rad_s
        found["acceleration_m_s2"] = robot.acceleration_m_s2
    if robot.drive == "unicycle":
        found["turn_acceleration_rad_s2"] = robot.turn_acceleration_rad_s2
    elif robot.drive == "differential":
        found["track_m"] = robot.track_m
    if robot.sight_m is not None:
        found["sight_m"] = robot.sight_m
    if robot.field_of_view_deg < 360.0:
        found["field_of_view_deg"] = robot.field_of_view_deg
    if robot.range_sensor is not None:
        sensor = robot.range_sensor
        found["range_sensor"] = {
            "rays": sensor.rays,
            "range_m": sensor.range_m,
            "angles_rad": sensor.angles_rad(),
        }
    if robot.battery is not None:
        found["battery_j"] = robot.battery.capacity_j
    if robot.load is not None:
        found["load"] = robot.load
    return found


def _spots_of(scenario: Scenario) -> dict[str, Any]:
    """Stations and depots, of which robots see the nearest."""
    found = {
        "stations": [one.position_m for one in scenario.stations],
        "depots": [one.position_m for one in scenario.depots],
    }
    return {name: places for name, places in found.items() if places}


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values as JSON has them."""
    found: dict[str, Any] = json.loads(json.dumps(values, allow_nan=False))
    return found


def network_of(config: RunConfig, names: Sequence[str], entities: EntityColumns | None) -> Network:
    """What numpy needs to know of the actors."""
    if isinstance(config.algorithm, TeamConfig):
        return pair_network(config.algorithm, config.scenario)
    frame = None
    if config.network.symmetry == "canonical":
        found = turning_columns(config.scenario, names)
        frame = FrameColumns(
            found.vectors, found.handed, found.anchors, found.rays, found.ray_turns
        )
    columns = None if entities is None else Entities(**asdict(entities))
    if columns is not None and config.network.pooling != "nearest":
        columns = replace(columns, teammate_place=None, victim_place=None)
    return Network(
        encoder=config.network.encoder,
        hidden_width=config.network.hidden_width,
        leaky_relu_slope=LEAKY_RELU_SLOPE,
        entities=columns,
        frame=frame,
        log_std=_log_std() if config.scenario.actions == "continuous" else None,
        pooling=config.network.pooling,
    )


def frame_in(network: Network, width: int, drive: str, continuous: bool) -> Frame | None:
    """The frame of robots with a drive; None where the network has none.

    Args:
        network: of the team.
        width: D.
        drive: what actions set, as `Robot.drive`.
        continuous: whether actions are.
    """
    if network.frame is None:
        return None
    return Frame(network.frame, width, None if continuous else _PUSHES, drive)


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
_AXES = "world axes, relative to the robot"
_UNITS = {
    "position": ("m", "world"),
    "velocity": ("m/s", "world"),
    "relative_position": ("m", _AXES),
    "relative_velocity": ("m/s", _AXES),
    "heading": ("1", "world"),
    "station": ("m", _AXES),
    "depot": ("m", _AXES),
    "turn_rate": ("rad/s", "none"),
    "ahead": ("m", "the robot's heading"),
    "left": ("m", "the robot's heading"),
}
_FAULT_UNITS = {"heading_bias": "rad", "position_noise": "m", "velocity_noise": "m/s"}
_SENSES = {
    "ray": "the robot's range sensor",
    "seen": "what the robot sees",
    "since_seen": "what the robot sees",
    "heard": "whom the robot hears",
}


def _column(name: str) -> dict[str, str]:
    owner, _, quantity = name.partition(".")
    first, *more = quantity.split(".")
    unit, frame = _UNITS.get(first, ("1", "none"))
    if first == "fault":
        unit = _FAULT_UNITS.get(more[0], "1")
    source = _SENSES.get(first, _SOURCES[owner.split("_")[0]])
    return {"name": name, "unit": unit, "frame": frame, "source": source}
