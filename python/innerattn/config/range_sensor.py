"""Range sensors of robots: how many rays, how far they reach, and what they meet."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from innerattn.config.model import Model, Told


class RangeSensor(Model):
    """A sensor that measures how far things are along rays from a robot's centre."""

    rays: Annotated[int, Field(ge=0, lt=2**32), Told(1, 360)] = Field(description="number of rays")
    range_m: Annotated[float, Told(0.005, 1_000.0)] = Field(
        description="how far each ray reaches from the robot's centre, above radius_m [m]"
    )
    field_of_view_deg: Annotated[float, Told(1.0, 360.0)] = Field(
        360.0,
        description="angle over which the rays spread, its middle straight ahead; below 360 only "
        "of robots with a heading [degrees]",
    )
    layers: Annotated[tuple[str, ...] | None, Told(1, 64)] = Field(
        None, description="layers whose robots and obstacles the rays meet; None: the robot's own"
    )

    def angles_rad(self) -> list[float]:
        """Angle of each ray from straight ahead, counterclockwise."""
        field = math.radians(self.field_of_view_deg)
        if self.field_of_view_deg >= 360.0:
            return [field * ray / self.rays for ray in range(self.rays)]
        if self.rays == 1:
            return [0.0]
        return [field * (ray / (self.rays - 1) - 0.5) for ray in range(self.rays)]
