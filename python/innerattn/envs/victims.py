"""Victims as a structured array: what `BatchEnv.victims` gives, and what `set_victims` takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config.scenario import Scenario

_FIELDS = [
    *(("present", "?"), ("task", "i8"), ("id", "i8"), ("appeared_step", "i8")),
    *(("x", "f4"), ("y", "f4")),
]


def victim_dtype(scenario: Scenario) -> np.dtype[np.void]:
    """The fields of `BatchEnv.victims`."""
    times = [("served", "f4")] * scenario.has_services
    times += [("deadline_step", "i8")] * scenario.has_deadlines
    return np.dtype(_FIELDS + times + [("blocked", "?")] * scenario.has_order)


def victim_table(
    numbers: NDArray[np.int64], places: NDArray[np.float32], scenario: Scenario
) -> NDArray[np.void]:
    """The victims of E worlds by slot, (E, V) structured.

    Args:
        numbers: (E, V, 6) present, task, id, appeared_step, deadline_step, blocked.
        places: (E, V, 3) x, y [m], served.
        scenario: the worlds' description.
    """
    table = np.empty(numbers.shape[:2], dtype=victim_dtype(scenario))
    columns = ("present", "task", "id", "appeared_step", "deadline_step", "blocked")
    sources = [*zip(columns, np.moveaxis(numbers, -1, 0), strict=True)]
    sources += zip(("x", "y", "served"), np.moveaxis(places, -1, 0), strict=True)
    for name, values in sources:
        if name in (table.dtype.names or ()):
            table[name] = values
    return table


def victim_columns(
    victims: NDArray[np.void], num_envs: int, scenario: Scenario
) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.float64]]:
    """Presence (E, V), tasks (E, V) and places (E, V, 2) [m] of a caller's victims.

    Raises:
        TypeError: other fields or dtypes than those of `victim_dtype`, or a masked array.
        ValueError: wrong shape.
    """
    shape = (num_envs, scenario.num_victims)
    wanted = f"must have shape {shape} and the fields of victims()"
    if isinstance(victims, np.ma.MaskedArray):
        raise TypeError(f"victims is a masked array, whose mask would be lost: it {wanted}")
    if not isinstance(victims, np.ndarray) or victims.dtype.names != victim_dtype(scenario).names:
        given = isinstance(victims, np.ndarray)
        found = f"has dtype {victims.dtype}" if given else "is no array"
        raise TypeError(f"victims {found}: {wanted}")
    for name, kinds in (("present", "b"), ("task", "iu"), ("x", "iuf"), ("y", "iuf")):
        field = victims.dtype[name]
        if field.kind not in kinds or field.itemsize > 8:
            raise TypeError(f"victims[{name!r}] has dtype {field}: {wanted}")
    if victims.shape != shape:
        raise ValueError(f"victims has shape {victims.shape}: {wanted}")
    places = np.stack([victims["x"], victims["y"]], -1, dtype=np.float64, casting="same_kind")
    return np.asarray(victims["present"]), np.asarray(victims["task"]), places
