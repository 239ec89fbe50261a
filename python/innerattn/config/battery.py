"""What robots use up: their batteries and loads, and the stations and depots that fill these."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from innerattn.config.model import Model, Told
from innerattn.errors import ConfigError

if TYPE_CHECKING:
    from innerattn.config.scenario import Scenario


class Battery(Model):
    """What a robot lives on; with an empty one it neither drives nor helps."""

    capacity_j: Annotated[float, Told(0.001, 1e9)] = Field(
        description="energy when an episode starts, and the most that it holds [J]"
    )
    per_m_j: Annotated[float, Told(0.0, 1e6)] = Field(
        0.0, description="energy used for each metre [J/m]"
    )
    idle_w: Annotated[float, Told(0.0, 1e6)] = Field(0.0, description="power used all the time [W]")


class Station(Model):
    """A place that charges the robots that stand on it; nothing touches it."""

    position_m: tuple[float, float] = Field(description="its centre, inside the walls [m]")
    radius_m: Annotated[float, Told(0.001, 10.0)] = Field(
        0.15, description="how near to it the centre of a robot must be [m]"
    )
    recharge_w: Annotated[float, Told(0.001, 1e6)] = Field(
        description="power that each robot there gets [W]"
    )


class Depot(Model):
    """A place that refills the loads of the robots that stand on it; nothing touches it."""

    position_m: tuple[float, float] = Field(description="its centre, inside the walls [m]")
    radius_m: Annotated[float, Told(0.001, 10.0)] = Field(
        0.15, description="how near to it the centre of a robot must be [m]"
    )


def refuse_stores_velocities_and_sights(scenario: Scenario, who: str) -> None:
    """Refuse a team with batteries or loads, for policies (``who``) that know neither.

    Robots whose actions set a velocity, and limited sight, are refused, too: such policies know
    forces alone, and see everything.

    Raises:
        ConfigError: a robot has a battery, a load or a limited sight, or actions set its velocity.
    """
    for index, robot in enumerate(scenario.robots):
        key = f"scenario.robots[{index}]"
        if robot.battery is not None:
            found = f"{key}.battery.capacity_j = {robot.battery.capacity_j:g}"
            raise ConfigError(f"{found}: there must be no battery; {who} see no charges")
        if robot.load is not None:
            found = f"{key}.load = {robot.load}"
            raise ConfigError(f"{found}: there must be no load; {who} see no loads")
        if robot.drive != "force":
            raise ConfigError(f"{key}.drive = {robot.drive!r}: must be 'force'; {who} set forces")
        if robot.sight_m is not None:
            found = f"{key}.sight_m = {robot.sight_m:g}"
            raise ConfigError(f"{found}: must be left out; {who} see everything")
    if scenario.occlusion:
        raise ConfigError(f"scenario.occlusion = true: must be false; {who} see everything")
