"""From records to what a replay page holds: names as JSON, steps as quantised, packed arrays."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import RunError
from innerattn.measures.moments import (
    blocked,
    fault_spells,
    handoffs_of_all_robots,
    obstacle_places,
)
from innerattn.records.record import Record
from innerattn.report.worlds import worlds_document

SCHEMA_VERSION = 1

NEEDED = ("actions", "positions", "velocities", "victims", "faults")
"""What must have been recorded step by step; attention and rewards are shown where they were."""

MOST_RECORDS = 4
"""As many policies a page shows side by side."""

_STEPS_OF_INT16 = 32000
"""Of positions, from the centre to a wall; of rewards, to the largest; and of half a circle."""

_TABLES = {
    "rescues": ("episode", "step", "victim", "task"),
    "lost": ("episode", "step", "victim", "task"),
    "handoffs": ("episode", "robot", "before", "after", "first", "second"),
    "faults": ("episode", "robot", "kind", "start", "end"),
}


class _Arrays:
    """Arrays end to end as bytes, each aligned for JavaScript's typed arrays."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: NDArray[Any]) -> dict[str, Any]:
        """Where an array of int16, int8, uint8, int32 or float32 lies, for the JSON."""
        data = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
        found = {"type": values.dtype.name, "at": self._size, "shape": list(values.shape)}
        padding = b"\0" * (-len(data) % 4)
        self._parts += [data, padding]
        self._size += len(data) + len(padding)
        return found

    def packed(self) -> str:
        """All arrays, compressed by gzip, as base64."""
        return base64.b64encode(gzip.compress(b"".join(self._parts), 9, mtime=0)).decode("ascii")


def replay_document(records: Sequence[Record], names: Sequence[str]) -> dict[str, Any]:
    """What a replay page shows, as plain values.

    Positions are rounded to 1/32,000 of the arena's half width, velocities to 1/127 of the largest,
    headings to 1/32,000 of half a circle, attention to 1/255, rewards to 1/32,000 of each
    component's largest, readings of range sensors up to 1/32,000.

    Args:
        records: of one to four policies, in the same worlds.
        names: what each is called.

    Raises:
        RunError: none or too many records, steps were not recorded, or worlds differ.
    """
    refuse_what_cannot_replay(records, names)
    first, arrays = records[0], _Arrays()
    return {
        "schema_version": SCHEMA_VERSION,
        "worlds": _worlds(first, arrays),
        "runs": [_run(record, name, arrays) for record, name in zip(records, names, strict=True)],
        "data": arrays.packed(),
    }


def refuse_what_cannot_replay(records: Sequence[Record], names: Sequence[str]) -> None:
    """Refuse records that no replay can show together.

    Raises:
        RunError: none or too many records, steps were not recorded, or worlds differ.
    """
    if not 1 <= len(records) <= MOST_RECORDS:
        raise RunError(f"{len(records)} policies to replay: must be 1 to {MOST_RECORDS}")
    for record, name in zip(records, names, strict=True):
        missing = [field for field in NEEDED if field not in record.steps]
        if missing:
            raise RunError(
                f"{name}: {', '.join(missing)} were not recorded step by step; "
                "--episodes N plays them again"
            )
        difference = _difference(records[0], record)
        if difference:
            raise RunError(
                f"{name}: was recorded in other worlds than {names[0]} ({difference}); "
                "--episodes N plays both in the same worlds"
            )


def _difference(one: Record, other: Record) -> str | None:
    """What the worlds of two records do not share; None: nothing."""
    if one.scenario != other.scenario:
        fields = type(one.scenario).model_fields
        keys = [k for k in fields if getattr(one.scenario, k) != getattr(other.scenario, k)]
        return f"another scenario: {', '.join(keys)}"
    for what, word in (
        ("seed", "seed"),
        ("first_episode", "first episode"),
        ("num_episodes", "number of episodes"),
    ):
        values = getattr(one, what), getattr(other, what)
        if values[0] != values[1]:
            return f"{word} {values[1]}, not {values[0]}"
    return None


def _worlds(record: Record, arrays: _Arrays) -> dict[str, Any]:
    unit = _unit(record.scenario)
    return worlds_document(record.scenario) | {
        "seed": str(record.seed),  # may be more than a number of JavaScript holds
        "first_episode": record.first_episode,
        "episodes": record.num_episodes,
        "obstacle_places": arrays.add(_quantised(obstacle_places(record), unit)),
        "position_unit_m": unit,
    }


def _unit(scenario: Any) -> float:
    return float(scenario.arena_half_width_m) / _STEPS_OF_INT16


def _quantised(values: NDArray[Any], unit: float, dtype: str = "int16") -> NDArray[Any]:
    limits = np.iinfo(dtype)
    return np.clip(np.rint(values / unit), limits.min, limits.max).astype(dtype)


def _run(record: Record, name: str, arrays: _Arrays) -> dict[str, Any]:
    steps = int(record.lengths.max())
    kept = {field: values[:, :steps] for field, values in record.steps.items()}
    fastest = max(float(np.abs(kept["velocities"]).max()), 1e-6)
    handed, spells = handoffs_of_all_robots(record), fault_spells(record)
    found: dict[str, Any] = {
        "name": name,
        "policy": record.policy,
        "lengths": arrays.add(record.lengths.astype(np.int32)),
        "positions": arrays.add(_quantised(kept["positions"], _unit(record.scenario))),
        "velocities": arrays.add(_quantised(kept["velocities"], fastest / 127, "int8")),
        "velocity_unit_mps": fastest / 127,
        "blocked": arrays.add(blocked(record)[:, :steps].astype(np.uint8)),
        "victims": arrays.add(_victims(record)),
        "rescues": arrays.add(_rescues(record)),
        "lost": arrays.add(_table(record.lost, "lost", record)),
        "handoffs": arrays.add(_table(handed, "handoffs", record)),
        "faults": arrays.add(_table(spells, "faults", record)),
        "fault_values": arrays.add(spells["value"].astype(np.float32)),
    }
    if "served" in (kept["victims"].dtype.names or ()):
        found["served"] = arrays.add(_quantised(kept["victims"]["served"], 1 / 255, "uint8"))
    if "blocked" in (kept["victims"].dtype.names or ()):
        found["waits"] = arrays.add(kept["victims"]["blocked"].astype(np.uint8))
    if "headings" in kept:
        found["headings"] = arrays.add(
            _quantised(kept["headings"][..., 0], np.pi / _STEPS_OF_INT16)
        )
    if "charge" in kept:
        charge = np.ceil(255 * kept["charge"])  # only an empty battery is 0
        found["charge"] = arrays.add(charge.astype(np.uint8))
    if "load" in kept:
        full = np.array([robot.load or 0 for robot in record.scenario.robots])
        found["load"] = arrays.add(np.rint(kept["load"] * full).astype(np.int16))
    if "heard" in kept:
        found["heard"] = arrays.add(kept["heard"].astype(np.uint8))
    if "rays" in kept:
        readings = np.ceil(_STEPS_OF_INT16 * kept["rays"].astype(np.float64))  # 0: met nothing
        found["rays"] = arrays.add(readings.astype(np.int16))
    for whose in ("attention", "actor_attention"):
        if whose in kept and record.scenario.num_robots > 1:
            found[whose] = arrays.add(_quantised(kept[whose], 1 / 255, "uint8"))
    if "rewards" in kept:
        found["rewards"] = _rewards(record, kept["rewards"], arrays)
    return found


def _rewards(record: Record, values: NDArray[Any], arrays: _Arrays) -> list[dict[str, Any]]:
    """The reward components that are not zero throughout."""
    found = []
    for index, name in enumerate(record.reward_names):
        unit = float(np.abs(values[..., index]).max()) / _STEPS_OF_INT16
        if unit > 0.0:
            packed = arrays.add(_quantised(values[..., index], unit))
            found.append({"name": name, "unit": unit, "values": packed})
    return found


def _table(rows: NDArray[np.void], name: str, record: Record) -> NDArray[np.int32]:
    """Columns of events as (N, columns); episodes are counted from the record's first."""
    columns = [rows[column].astype(np.int32) for column in _TABLES[name]]
    table = np.stack(columns, -1)
    table[:, 0] -= record.first_episode
    return table


def _rescues(record: Record) -> NDArray[np.int32]:
    """(N, 4 + K): episode, step, victim, task, and the helper of each need (-1: no such need)."""
    helpers = [n for n in record.rescues.dtype.names or () if n.startswith("helper_")]
    table = _table(record.rescues, "rescues", record)
    return np.hstack([table, *(record.rescues[n].astype(np.int32)[:, None] for n in helpers)])


def _victims(record: Record) -> NDArray[np.int32]:
    """A row (9) for each victim.

    Its columns are episode, id, task, first step and first step without it, x and y in position
    units, slot, and the steps done when it is lost (-1: never).

    A victim stays where it is from its appearance on.
    """
    victims = record.steps["victims"]
    happened = np.arange(victims.shape[1]) < record.lengths[:, None]
    episode, step, slot = np.nonzero(victims["present"] & happened[..., None])
    seen = victims[episode, step, slot]
    order = np.lexsort((step, seen["id"], episode))
    episode, step, slot, seen = episode[order], step[order], slot[order], seen[order]
    key = np.stack([episode, seen["id"]], -1)
    begins = np.flatnonzero(np.r_[True, (key[1:] != key[:-1]).any(1)][: len(key)])
    ends = np.r_[begins[1:], len(key)] - 1 if len(key) else begins
    places = _quantised(np.stack([seen["x"], seen["y"]], -1), _unit(record.scenario), "int32")
    columns = (episode, seen["id"], seen["task"])
    has_deadlines = "deadline_step" in (seen.dtype.names or ())
    deadline = seen["deadline_step"] if has_deadlines else np.full(len(seen), -1)
    return np.stack(
        [
            *(column[begins] for column in columns),
            step[begins],
            step[ends] + 1,
            *(places[begins, axis] for axis in (0, 1)),
            slot[begins],
            np.minimum(deadline[begins], np.iinfo(np.int32).max),
        ],
        -1,
    ).astype(np.int32)
