"""What pages that draw worlds know of them, as plain values."""

from __future__ import annotations

import math
from typing import Any

from innerattn import _core
from innerattn.config import Map, Scenario
from innerattn.config.scenario import Robot


def worlds_document(scenario: Scenario) -> dict[str, Any]:
    """Everything about worlds that does not change while they are played."""
    return {
        "situation": scenario.situation,
        "dt_s": scenario.dt_s,
        "half_width_m": scenario.arena_half_width_m,
        "rescue_radius_m": scenario.rescue_radius_m,
        "has_services": scenario.has_services,
        "has_deadlines": scenario.has_deadlines,
        "has_order": scenario.has_order,
        "robots_leave": scenario.robots_leave,
        "layers": scenario.layers,
        "occlusion": scenario.occlusion,
        "limits_communication": scenario.limits_communication,
        "tasks": [
            {
                "name": task.name,
                "needs": list(task.needs),
                "amounts": task.sums,
                "after": list(task.after),
            }
            for task in scenario.tasks
        ],
        "robots": [
            {
                "name": robot.name,
                "kind": robot.kind,
                "abilities": list(robot.abilities),
                "amounts": robot.abilities if isinstance(robot.abilities, dict) else {},
                "radius_m": robot.radius_m,
                "has_battery": robot.battery is not None,
                "load": robot.load,
                "layer": robot.layer,
                "has_wheels": robot.has_wheels,
            }
            | _senses(robot)
            for robot in scenario.robots
        ],
        "fault_kinds": [
            {"name": name, "unit": unit, "healthy": healthy, "least": least, "most": most}
            for name, unit, least, most, healthy, _ in _core.FAULT_KINDS
        ],
        "stations": [
            {"position_m": one.position_m, "radius_m": one.radius_m} for one in scenario.stations
        ],
        "depots": [
            {"position_m": one.position_m, "radius_m": one.radius_m} for one in scenario.depots
        ],
        "obstacles": [
            {
                "radius_m": one.radius_m,
                "half_extents_m": one.half_extents_m,
                "passed_by": [layer for layer in scenario.layers if not one.blocks(layer)],
            }
            for one in scenario.obstacles
        ],
        "map": None if scenario.map is None else _map(scenario, scenario.map),
    }


def _senses(robot: Robot) -> dict[str, Any]:
    """The range sensor and the limits of sight of a robot that has such."""
    found: dict[str, Any] = {}
    if robot.range_sensor is not None:
        sensor = robot.range_sensor
        found["range_sensor"] = {"range_m": sensor.range_m, "angles_rad": sensor.angles_rad()}
    if robot.has_limited_sight:
        found["sight"] = {
            "range_m": robot.sight_m,
            "field_of_view_rad": math.radians(robot.field_of_view_deg),
        }
    return found


def _map(scenario: Scenario, found: Map) -> dict[str, Any]:
    """Boxes over the solid cells: the centre of each and its half extents [m]."""
    boxes = scenario.map_boxes
    return {
        "boxes": [[*(one.position_m or ()), *(one.half_extents_m or ())] for one in boxes],
        "passed_by": [layer for layer in scenario.layers if not found.blocks(layer)],
    }
