"""A number with its interval, as every table, file and sentence reports it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Estimate:
    """A number and its 95 % interval.

    An unbounded interval says that nothing limits the number, as with a single run. The ends are
    always numbers, so that comparisons with them need no special case.

    Attributes:
        mean: a mean, a ratio of means, a share, or an area under a curve.
        low: low end; -inf where there is none.
        high: high end; inf where there is none.
        runs: how many runs it is over; 0 where it is over the episodes of one run.
    """

    mean: float
    low: float = -math.inf
    high: float = math.inf
    runs: int = 0

    @property
    def bounded(self) -> bool:
        """Whether both ends of the interval are finite."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    def to_json(self) -> dict[str, float | int | None]:
        """``mean``, ``low``, ``high``, null where not finite, and ``runs`` if it is over runs."""
        ends = {"mean": self.mean, "low": self.low, "high": self.high}
        known: dict[str, float | int | None] = {
            name: value if math.isfinite(value) else None for name, value in ends.items()
        }
        return known | ({"runs": self.runs} if self.runs else {})

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Estimate:
        """What `to_json` wrote.

        Raises:
            KeyError: a key is missing.
            TypeError: the mean is null, or a value is no number.
        """
        low, high = document["low"], document["high"]
        return cls(
            float(document["mean"]),
            -math.inf if low is None else float(low),
            math.inf if high is None else float(high),
            int(document.get("runs", 0)),
        )


def as_json(value: Any) -> Any:
    """A value as JSON has it.

    Dataclasses become objects by field, estimates as `Estimate.to_json` writes them, tuples and
    arrays lists; numbers of arrays that are not finite are null.
    """
    if isinstance(value, Estimate):
        return value.to_json()
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: as_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(part) for part in value]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        nested = value.astype(object)
        nested[~np.isfinite(value)] = None
        return nested.tolist()
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
