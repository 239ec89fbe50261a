"""What policies that know robots by their bodies and needs alone refuse of a scenario."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from innerattn.errors import ConfigError

if TYPE_CHECKING:
    from innerattn.config.scenario import Robot, Scenario


def refuse_stores_drives_and_senses(scenario: Scenario, who: str) -> None:
    """Refuse what policies (``who``) do not know that set forces and see and hear everything.

    Raises:
        ConfigError: a robot has a battery, a load, a range sensor or a limited sight, actions set
            no force, or something limits who hears whom or what is in an observation.
    """
    for key in ("observed_teammates", "observed_victims"):
        if (most := getattr(scenario, key)) is not None:
            raise ConfigError(f"scenario.{key} = {most}: must be left out; {who} see everything")
    for index, robot in enumerate(scenario.robots):
        _refuse_robot(robot, f"scenario.robots[{index}]", who)
    if scenario.occlusion:
        raise ConfigError(f"scenario.occlusion = true: must be false; {who} see everything")
    if scenario.limits_communication:
        found = scenario.communication
        limits = found.model_dump(exclude_defaults=True) if found else {}
        shown = ", ".join(f"{key} = {json.dumps(value)}" for key, value in limits.items())
        raise ConfigError(
            f"scenario.communication = {{ {shown} }}: must be left out; "
            f"{who} do not know who hears whom"
        )


def _refuse_robot(robot: Robot, key: str, who: str) -> None:
    if robot.battery is not None:
        found = f"{key}.battery.capacity_j = {robot.battery.capacity_j:g}"
        raise ConfigError(f"{found}: there must be no battery; {who} see no charges")
    if robot.load is not None:
        raise ConfigError(f"{key}.load = {robot.load}: there must be no load; {who} see no loads")
    if robot.field_of_view_deg < 360.0:
        found = f"{key}.field_of_view_deg = {robot.field_of_view_deg:g}"
        raise ConfigError(f"{found}: must be 360; {who} see everything")
    if robot.drive != "force":
        raise ConfigError(f"{key}.drive = {robot.drive!r}: must be 'force'; {who} set forces")
    if robot.sight_m is not None:
        found = f"{key}.sight_m = {robot.sight_m:g}"
        raise ConfigError(f"{found}: must be left out; {who} see everything")
    if robot.range_sensor is not None:
        found = f"{key}.range_sensor.rays = {robot.range_sensor.rays}"
        raise ConfigError(f"{found}: there must be no range sensor; {who} measure no distances")
