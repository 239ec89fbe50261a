"""The map of an arena: which cells of a grid over it are solid."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from innerattn.config.model import Model, Told


class Map(Model):
    """Solid cells of a grid over the whole arena."""

    rows: Annotated[tuple[str, ...], Told(2, 200)] = Field(
        description="the grid from top to bottom, a text of as many cells for each row: '#' is "
        "solid, '.' is free; in a TOML file `file` may stand in its place"
    )
    layers: Annotated[tuple[str, ...] | None, Told(1, 64)] = Field(
        None, description="layers of the robots that solid cells block; None: all"
    )

    def blocks(self, layer: str) -> bool:
        """Whether robots of a layer touch solid cells."""
        return self.layers is None or layer in self.layers

    @cached_property
    def solid(self) -> NDArray[np.bool_]:
        """Which cells are solid, (N, N): rows from top to bottom, columns from left to right."""
        return np.array([[cell == "#" for cell in row] for row in self.rows])
