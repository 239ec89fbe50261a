"""Arrays of networks as one list of numbers, in which a page finds each by its place."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Weights:
    """Arrays one after the other.

    Attributes:
        places: where each begins, and its shape, by name, as JSON.
    """

    def __init__(self) -> None:
        """Begin without an array."""
        self.places: dict[str, dict[str, Any]] = {}
        self._parts: list[NDArray[np.float32]] = []
        self._end = 0

    def add(self, name: str, values: NDArray[np.float32]) -> None:
        """Add an array of any shape."""
        self.places[name] = {"begin": self._end, "shape": list(values.shape)}
        self._parts.append(values.ravel())
        self._end += values.size

    def numbers(self) -> NDArray[np.float32]:
        """(N,) float32, all numbers."""
        return np.concatenate(self._parts)
