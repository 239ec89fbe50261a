"""What robots use up: their batteries and loads, and the stations and depots that fill these."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from innerattn.config.model import Model, Told


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
