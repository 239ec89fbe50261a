"""How robots communicate: who hears whom, when, and what they tell each other."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from innerattn.config.model import Model, Told


class Communication(Model):
    """How far, how late and how surely robots hear each other."""

    range_m: Annotated[float | None, Told(0.005, 1_000.0)] = Field(
        None,
        description="how far a robot is heard, from centre to centre when it sends [m]; None: "
        "everywhere",
    )
    delay_steps: Annotated[int, Field(ge=0, lt=2**32), Told(0, 20)] = Field(
        0, description="control steps from sending to hearing"
    )
    loss: float = Field(
        0.0,
        description="chance that what one robot sends to another in a step does not arrive, at "
        "least 0 and below 1",
    )
    share: Literal["nothing", "victims"] = Field(
        "nothing",
        description="what robots tell those who hear them; victims: which victims they see "
        "themselves, only where something limits sight",
    )

    @property
    def limits(self) -> bool:
        """Whether some robots do not hear others, or not at once."""
        return self.range_m is not None or self.delay_steps > 0 or self.loss > 0.0
