"""Episode records as Parquet files, so that every table can be computed again without training.

One file has a row per episode, the other a row per rescue. It computes no figure.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.config.files import write_whole
from innerattn.config.untrusted import read_plain
from innerattn.errors import RunError
from innerattn.records.record import FIELDS, LOST_DTYPE, Length, Record, rescue_dtype
from innerattn.records.run_files import RunFiles
from innerattn.records.tables import MOST_FILE_BYTES, read_table, table_bytes
from innerattn.records.validity import refuse_impossible, step_dtype, step_shape

FORMAT = "innerattn.records"
SCHEMA_VERSION = 1

RECORD_FILES = _EPISODES, _RESCUES = "episodes.parquet", "rescues.parquet"

_SUMS = ("record", "episode", "steps", "rescues", "reward", "lost", "turned_away")
"""Columns of ``episodes.parquet`` that records are made of; the others are labels and steps. The
last two are there only where a scenario has deadlines, and arrivals."""
_OF_LOST = ("step", "slot", "victim", "task")
_MOST_RECORDS = 1_000


def write_records(records: Sequence[Record], folder: Path) -> None:
    """Write ``episodes.parquet`` and ``rescues.parquet`` into ``folder``, which is made if needed.

    A row of the first holds policy, seed, episode, steps, rescues, reward sums by robot and
    component, lost victims where the scenario has deadlines (step, slot, victim and task of each),
    how many found no slot where victims arrive, and what was recorded step by step, flattened;
    shapes and the scenario stand in the file's metadata. A row of the second holds one event;
    helpers are named.

    Raises:
        OSError: the files cannot be written; each is written whole or not at all.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _write(
        [_episode_table(i, record) for i, record in enumerate(records)], records, folder / _EPISODES
    )
    _write(
        [_rescue_table(i, record) for i, record in enumerate(records)], records, folder / _RESCUES
    )


def read_records(
    folder: str | Path,
    *,
    policy: str | None = None,
    steps: bool = True,
) -> list[Record]:
    """The records that `write_records` wrote, in their order.

    Args:
        folder: where they lie.
        policy: whose records; None: everybody's.
        steps: whether to read what was recorded step by step, which is most of the file.

    Raises:
        RunError: a file is missing, a link, not Parquet, not of this format and version, too large
            when it is unpacked, or not the one that its run was sealed with; the two do not belong
            together, or hold what no play leaves behind.
    """
    folder = Path(folder)
    in_run = (folder.parent / "run.json").is_file()
    files = RunFiles(folder.parent) if in_run else None
    episodes, heads = _read(folder / _EPISODES, files, None if steps else _SUMS)
    rescues, others = _read(folder / _RESCUES, files)
    if heads != others:
        raise RunError(f"{folder}: {_EPISODES} and {_RESCUES} are of different episodes")
    try:
        rows, events = (_by_record(table, len(heads)) for table in (episodes, rescues))
        lengths = _lengths(heads, rows)
        scenarios: dict[str, Scenario] = {}
        return [
            _record(head, lengths[i], rows[i], events[i], steps, scenarios)
            for i, head in enumerate(heads)
            if policy in (None, head["policy"])
        ]
    except (
        *(LookupError, ValueError, TypeError, AttributeError, OverflowError),
        pa.ArrowException,
    ) as error:
        raise RunError(f"{folder}: records do not fit their description ({error})") from error


def _head(record: Record) -> dict[str, Any]:
    """What all rows of a record share."""
    return {
        "policy": record.policy,
        "scenario": record.scenario.model_dump(mode="json"),
        "robot_names": list(record.robot_names),
        "seed": record.seed,
        "length": record.length,
        "reward_names": list(record.reward_names),
        "steps": {
            name: {"dtype": _dtype_text(values.dtype), "shape": list(values.shape[1:])}
            for name, values in record.steps.items()
        },
    }


def _dtype_text(dtype: np.dtype[Any]) -> Any:
    """A dtype as JSON: a string, or a list of [field, string] pairs."""
    return [[n, dtype[n].str] for n in dtype.names] if dtype.names else dtype.str


def _episode_table(index: int, record: Record) -> pa.Table:
    count = record.num_episodes
    columns: dict[str, Any] = {
        "record": pa.array(np.full(count, index)),
        "policy": pa.array([record.policy] * count),
        "situation": pa.array([record.scenario.situation] * count),
        "seed": pa.array(np.full(count, record.seed)),
        "episode": pa.array(record.first_episode + np.arange(count)),
        "steps": pa.array(record.lengths),
        "rescues": pa.array(record.rescue_counts()),
        "reward": _lists(record.rewards_total),
    }
    if record.scenario.has_deadlines:
        columns["lost"] = _lost_lists(record)
    if record.turned_away is not None:
        columns["turned_away"] = pa.array(record.turned_away)
    for name, values in record.steps.items():
        columns |= {column: _lists(part) for column, part in _parts(name, values)}
    return pa.table(columns)


def _parts(name: str, values: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """A structured array by its fields, any other as it is; with column names."""
    if values.dtype.names is None:
        yield name, values
    else:
        for part in values.dtype.names:
            yield f"{name}.{part}", np.ascontiguousarray(values[part])


def _lists(values: NDArray[Any]) -> pa.Array:
    """One flat list per episode."""
    flat = values.reshape(len(values), -1)
    offsets = np.arange(len(flat) + 1, dtype=np.int64) * flat.shape[1]
    return pa.LargeListArray.from_arrays(pa.array(offsets), pa.array(flat.ravel()))


def _lost_lists(record: Record) -> pa.Array:
    """The lost victims of each episode end to end: step, slot, victim, task."""
    ends = np.searchsorted(
        record.lost["episode"], record.first_episode + np.arange(record.num_episodes + 1)
    )
    flat = np.stack([record.lost[name] for name in _OF_LOST], -1).ravel()
    return pa.LargeListArray.from_arrays(pa.array(ends * len(_OF_LOST)), pa.array(flat))


def _lost(rows: pa.Table, scenario: Scenario, first_episode: int) -> NDArray[np.void]:
    """What `_lost_lists` wrote.

    Raises:
        ValueError: it is missing, or no whole number of victims.
    """
    if not scenario.has_deadlines:
        return np.empty(0, LOST_DTYPE)
    column = rows["lost"].combine_chunks()
    numbers = _arrays(rows["lost"]).reshape(-1, len(_OF_LOST))
    sizes = np.asarray(pc.list_value_length(column).to_numpy(zero_copy_only=False))
    if (sizes % len(_OF_LOST)).any():
        raise ValueError("lost: must have four numbers for each victim")
    lost = np.empty(len(numbers), LOST_DTYPE)
    for at, name in enumerate(_OF_LOST):
        lost[name] = numbers[:, at]
    lost["episode"] = first_episode + np.repeat(np.arange(len(rows)), sizes // len(_OF_LOST))
    return lost


def _rescue_table(index: int, record: Record) -> pa.Table:
    events = record.rescues
    robots = np.array([*record.robot_names, None], dtype=object)  # -1 is nobody
    tasks = np.array([task.name for task in record.scenario.tasks], dtype=object)
    columns: dict[str, Any] = {"record": np.full(len(events), index)}
    columns["policy"] = pa.array([record.policy] * len(events), pa.string())
    for name in events.dtype.names or ():
        values = events[name]
        if name.startswith("helper_"):
            columns[name] = pa.array(robots[values], pa.string())
        elif name == "task":
            columns[name] = pa.array(tasks[values], pa.string())
        else:
            columns[name] = pa.array(np.ascontiguousarray(values))
    return pa.table(columns)


def _write(tables: list[pa.Table], records: Sequence[Record], path: Path) -> None:
    table = pa.concat_tables(tables, promote_options="default")
    heads = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "records": [_head(record) for record in records],
    }
    table = table.replace_schema_metadata({FORMAT: json.dumps(heads)})
    write_whole(path, table_bytes(table))


def _read(
    path: Path, files: RunFiles | None, columns: Sequence[str] | None = None
) -> tuple[pa.Table, list[dict[str, Any]]]:
    """Some columns of a file, or all, and what it says of its records."""
    if not os.path.lexists(path):
        raise RunError(f"{path}: no such file")
    if files is None:
        data = read_plain(path, MOST_FILE_BYTES)
    else:
        data = files.read(f"{path.parent.name}/{path.name}", MOST_FILE_BYTES)
    table, head = read_table(data, path, FORMAT, SCHEMA_VERSION, columns)
    records = head.get("records")
    if not isinstance(records, list) or not all(isinstance(one, dict) for one in records):
        raise RunError(f"{path}: not a file of {FORMAT}")
    if len(records) > _MOST_RECORDS:
        raise RunError(f"{path}: has {len(records):,} records: must be at most {_MOST_RECORDS:,}")
    return table, records


def _by_record(table: pa.Table, count: int) -> list[pa.Table]:
    """The rows of each record.

    Raises:
        ValueError: they do not stand in the order of the records.
    """
    numbers = _numbers(table["record"])
    if (np.diff(numbers) < 0).any():
        raise ValueError("rows must stand in the order of their records")
    ends = np.searchsorted(numbers, np.arange(count + 1))
    return [table.slice(a, b - a) for a, b in itertools.pairwise(ends.tolist())]


def _lengths(heads: Sequence[dict[str, Any]], episodes: Sequence[pa.Table]) -> list[Length]:
    """Which length of an evaluation each record is of.

    Files that are older than this label hold, of each policy, the standard length first: a record
    that begins at episode 0 again is of the second one.
    """
    begun: set[str] = set()
    lengths: list[Length] = []
    for head, rows in zip(heads, episodes, strict=True):
        name = head["policy"]
        again = name in begun and int(_numbers(rows["episode"])[0]) == 0
        lengths.append(head.get("length", "long" if again else "standard"))
        begun.add(name)
    return lengths


def _record(
    head: dict[str, Any],
    length: Length,
    rows: pa.Table,
    events: pa.Table,
    steps: bool,
    scenarios: dict[str, Scenario],
) -> Record:
    described = json.dumps(head["scenario"])
    if described not in scenarios:
        scenarios[described] = Scenario.model_validate(head["scenario"])
    scenario = scenarios[described]
    names, reward_names = tuple(head["robot_names"]), tuple(head["reward_names"])
    lengths = _numbers(rows["steps"])
    first_episode = int(_numbers(rows["episode"])[0])
    record = Record(
        policy=head["policy"],
        scenario=scenario,
        robot_names=names,
        seed=head["seed"],
        first_episode=first_episode,
        lengths=lengths,
        rescues=_events(events, scenario, names),
        lost=_lost(rows, scenario, first_episode),
        turned_away=_numbers(rows["turned_away"]) if scenario.has_arrivals else None,
        reward_names=reward_names,
        rewards_total=_arrays(rows["reward"]).reshape(len(rows), len(names), len(reward_names)),
        length=length,
        steps={
            name: _steps(name, head["steps"][name], rows, scenario.episode_steps)
            for name in FIELDS
            if steps and name in head["steps"]
        },
    )
    refuse_impossible(record)
    listed, counted = record.rescue_counts(), _numbers(rows["rescues"])
    if not np.array_equal(listed, counted):
        raise ValueError(f"{listed.sum()} rescues are listed, {counted.sum()} were counted")
    return record


def _steps(name: str, layout: dict[str, Any], rows: pa.Table, length: int) -> NDArray[Any]:
    dtype = step_dtype(layout["dtype"])

    def part_of(column: str) -> NDArray[Any]:
        values = _arrays(rows[column])
        return values.reshape(step_shape(len(rows), layout["shape"], length, values.size))

    if dtype.names is None:
        return part_of(name).astype(dtype, copy=False)
    parts = {part: part_of(f"{name}.{part}") for part in dtype.names}
    values = np.empty(next(iter(parts.values())).shape, dtype)
    for part, numbers in parts.items():
        values[part] = numbers
    return values


def _events(rows: pa.Table, scenario: Scenario, robot_names: tuple[str, ...]) -> NDArray[np.void]:
    events = np.empty(len(rows), rescue_dtype(scenario))
    numbers: dict[str | None, int] = {name: i for i, name in enumerate(robot_names)} | {None: -1}
    tasks = {task.name: i for i, task in enumerate(scenario.tasks)}
    for name in events.dtype.names or ():
        if name.startswith("helper_"):
            events[name] = _numbered(rows[name], numbers)
        elif name == "task":
            events[name] = _numbered(rows[name], tasks)
        else:
            events[name] = _numbers(rows[name])
    return events


def _numbered(column: pa.ChunkedArray, numbers: Mapping[Any, int]) -> NDArray[np.int64]:
    """The number of each text; each text is looked up once.

    Raises:
        KeyError: a text that has no number.
    """
    packed = column.combine_chunks().dictionary_encode("encode")
    known = np.array([numbers[text] for text in packed.dictionary.to_pylist()], np.int64)
    places: NDArray[np.int64] = packed.indices.to_numpy(zero_copy_only=False).astype(np.int64)
    return known[places]


def _numbers(column: pa.ChunkedArray) -> NDArray[Any]:
    return np.asarray(column.to_numpy())


def _arrays(column: pa.ChunkedArray) -> NDArray[Any]:
    """All lists of a column, end to end."""
    return np.asarray(column.combine_chunks().flatten().to_numpy(zero_copy_only=False))
