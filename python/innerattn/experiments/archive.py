"""Finished runs of a study in one Parquet file, small enough to publish.

A row is a run: its case, configuration, ``run.json`` and summary as JSON, and of its own episodes
of the standard length the lengths, rescues and reward sums. Weights, metrics, what was recorded
step by step and the episodes of other policies are left out. What a study measured a run in beside
its own evaluation, such as faults, stands there as JSON, too. The file holds a digest of its
contents. A study takes an archived run for the run itself; what needs the rest, such as Fig. 4 and
Fig. 5, refuses it.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from innerattn.config import RunConfig
from innerattn.config.files import write_whole
from innerattn.config.untrusted import parse_json, read_plain
from innerattn.errors import RunError, UnsealedRunWarning
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, check_summary
from innerattn.records.record import Record, rescue_dtype
from innerattn.records.run_folder import run_info
from innerattn.records.tables import MOST_FILE_BYTES, read_table, table_bytes
from innerattn.records.validity import refuse_impossible

FORMAT = "innerattn.archive"
SCHEMA_VERSION = 1
FILE = "archive.parquet"
"""The name of a study's archive in its folder."""

_SHA256 = "sha256"
_TEXTS = ("situation", "method", "variant", "name", "config", "info", "summary")
_BESIDE = "beside"
"""A column of archives whose runs were measured in more than their own evaluation."""
_COMPRESSION_LEVEL = 19
_MOST_RUNS = 10_000


def write_archive(runs: Iterable[FinishedRun], path: Path) -> None:
    """Write finished runs to ``path``; the file appears whole or not at all.

    The same runs give the same bytes.

    Raises:
        RunError: records of a run cannot be read, or runs have different reward components.
        OSError: a file cannot be read or written.
    """
    rows = [_row(run) for run in runs]
    names = {tuple(row.pop("reward_names")) for row in rows}
    if len(names) > 1:
        raise RunError(f"{path}: runs have the reward components {sorted(names)}: must be the same")
    # Victims of some worlds have more helpers than those of others.
    columns = {
        key: pa.array([row.get(key, _nothing(key)) for row in rows], _type(key))
        for key in _keys(rows)
    }
    head = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "reward_names": list(names.pop()) if names else [],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(path, pa.table(columns), head)


def seal_archive(path: Path) -> int:
    """Write into an archive that has none the digest of what it holds.

    Returns:
        The number of its runs.

    Raises:
        RunError: it has one already; or as of `read_archive`, or of a run's records.
        OSError: the file cannot be written.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnsealedRunWarning)
        runs = read_archive(path)
    for run in runs:
        run.read()
    table, head = read_table(read_plain(path, MOST_FILE_BYTES), path, FORMAT, SCHEMA_VERSION)
    if _SHA256 in head:
        raise RunError(f"{path}: holds the digest of its contents already, and fits it")
    _write(path, table, head)
    return len(runs)


def _write(path: Path, table: pa.Table, head: dict[str, Any]) -> None:
    text = json.dumps({**head, _SHA256: _digest(table, head)})
    table = table.replace_schema_metadata({FORMAT: text})
    write_whole(path, table_bytes(table, _COMPRESSION_LEVEL))


def _digest(table: pa.Table, head: dict[str, Any]) -> str:
    """SHA-256 of all columns and of what the file says of itself, but for the digest."""
    known = {key: value for key, value in head.items() if key != _SHA256}
    digest = hashlib.sha256(json.dumps(known, sort_keys=True).encode())
    for name in sorted(table.column_names):
        column = table[name].combine_chunks()
        digest.update(json.dumps([name, column.null_count]).encode())
        if not pa.types.is_large_list(column.type):
            digest.update(json.dumps(column.to_pylist()).encode())
            continue
        digest.update(np.asarray(column.value_lengths().to_numpy(False), "<i8").tobytes())
        values = column.flatten().to_numpy(False)
        kind = values.dtype.newbyteorder("<")
        digest.update(kind.str.encode() + values.astype(kind).tobytes())
    return digest.hexdigest()


def _fits(table: pa.Table, head: dict[str, Any]) -> bool:
    """Whether columns that were read have the digest that the file says; no text may be broken."""
    try:
        return bool(head[_SHA256] == _digest(table, head))
    except UnicodeDecodeError:
        return False


def _refuse_other_columns(path: Path, table: pa.Table) -> None:
    """Refuse names that are broken or there twice, and types that are not those of their names."""
    try:
        types = {field.name: field.type for field in table.schema}
    except UnicodeDecodeError as error:
        raise RunError(f"{path}: a column's name is broken") from error
    if len(types) != table.num_columns:
        raise RunError(f"{path}: two columns have the same name")
    for name, found in types.items():
        if found != _type(name):
            raise RunError(f"{path}: column {name!r} holds {found}: must hold {_type(name)}")


def read_archive(path: Path) -> list[FinishedRun]:
    """The runs that `write_archive` wrote, in their order, with ``archived`` set.

    Each run's ``folder`` is ``runs/NAME`` beside the archive, where it would lie in a study.

    Warns:
        UnsealedRunWarning: it holds no digest of its contents, as older archives do not.

    Raises:
        RunError: the file is missing, a link, damaged, of another format or version, or a run's
            summary does not fit its configuration.
    """
    data = read_plain(path, MOST_FILE_BYTES)
    table, head = read_table(data, path, FORMAT, SCHEMA_VERSION)
    _refuse_other_columns(path, table)
    if _SHA256 not in head:
        text = f"{path}: holds no digest; its runs are read unchecked"
        warnings.warn(text, UnsealedRunWarning, stacklevel=1)
    elif not _fits(table, head):
        raise RunError(f"{path}: does not fit its own digest; it was altered")
    if len(table) > _MOST_RUNS:
        raise RunError(f"{path}: has {len(table):,} runs: must be at most {_MOST_RUNS:,}")
    try:
        reward_names = tuple(head["reward_names"])
        there = [_BESIDE] if _BESIDE in table.column_names else []
        texts = table.select([*_TEXTS, "seed", *there]).to_pylist()
        configs: dict[str, RunConfig] = {}
        return [_run(path, table, i, row, reward_names, configs) for i, row in enumerate(texts)]
    except (LookupError, ValueError, TypeError, AttributeError, pa.ArrowException) as error:
        raise RunError(f"{path}: runs do not fit their description ({error})") from error


def _keys(rows: Sequence[dict[str, Any]]) -> list[str]:
    """All columns, in the order in which runs first have them."""
    return list(dict.fromkeys(key for row in rows for key in row))


def _nothing(key: str) -> str | tuple[()]:
    """What a run that lacks a column has in it."""
    return "{}" if key == _BESIDE else ()


def _type(key: str) -> pa.DataType:
    if key in (*_TEXTS, _BESIDE):
        return pa.string()
    if key == "seed":
        return pa.int64()
    return pa.large_list(pa.float64() if key.startswith("reward_") else pa.int32())


def _row(run: FinishedRun) -> dict[str, Any]:
    records = run.scored
    rescues = np.concatenate([record.rescues for record in records])
    rewards = np.concatenate([record.rewards_total for record in records])
    row: dict[str, Any] = {
        "situation": run.case.worlds,
        "method": run.method,
        "variant": run.case.variant,
        "seed": run.seed,
        "name": run.folder.name,
        "config": json.dumps(run.config.model_dump(mode="json")),
        "info": json.dumps(asdict(run.info)),
        "summary": json.dumps(run.summary),
        "recorded": [records[0].num_episodes],
        "lengths": np.concatenate([record.lengths for record in records]),
        "reward_names": records[0].reward_names,
    }
    for index, name in enumerate(records[0].reward_names):
        row[f"reward_{name}"] = rewards[:, :, index].ravel()
    for name in rescues.dtype.names or ():
        row[f"rescue_{name}"] = np.ascontiguousarray(rescues[name])
    if run.beside:
        row[_BESIDE] = json.dumps(run.beside, sort_keys=True)
    return row


def _run(
    path: Path,
    table: pa.Table,
    index: int,
    row: dict[str, Any],
    reward_names: tuple[str, ...],
    configs: dict[str, RunConfig],
) -> FinishedRun:
    case = Case(row["situation"], row["method"], row["seed"], row["variant"])
    text = row["config"]
    if text not in configs:  # one text may stand in many rows
        configs[text] = RunConfig.model_validate(parse_json(text))
    config = configs[text]
    where = Path(f"{path}: {row['name']}")
    return FinishedRun(
        case=case,
        folder=path.parent / "runs" / row["name"],
        config=config,
        info=run_info(parse_json(row["info"])),
        summary=check_summary(where, parse_json(row["summary"]), config),
        read=lambda: _records(path, case, config, table, index, reward_names),
        archived=True,
        beside=dict(parse_json(row.get(_BESIDE, "{}"))),
    )


def _records(
    path: Path,
    case: Case,
    config: RunConfig,
    table: pa.Table,
    index: int,
    reward_names: tuple[str, ...],
) -> list[Record]:
    """The episodes that were recorded step by step, now without their steps, and the others."""

    def values(column: str) -> NDArray[Any]:
        return np.asarray(table[column][index].values.to_numpy())

    scenario = config.scenario
    lengths = values("lengths").astype(np.int64)
    rescues = np.empty(len(values("rescue_episode")), rescue_dtype(scenario))
    for name in rescues.dtype.names or ():
        rescues[name] = values(f"rescue_{name}")
    rewards = np.stack([values(f"reward_{name}") for name in reward_names], -1)
    rewards = rewards.reshape(len(lengths), scenario.num_robots, len(reward_names))
    recorded = int(values("recorded")[0])
    parts = [slice(0, recorded), slice(recorded, len(lengths))]
    records = [
        Record(
            policy=case.method,
            scenario=scenario,
            robot_names=tuple(robot.name for robot in scenario.robots),
            seed=config.evaluate.seed,
            first_episode=part.start,
            lengths=lengths[part],
            rescues=rescues[(rescues["episode"] >= part.start) & (rescues["episode"] < part.stop)],
            reward_names=reward_names,
            rewards_total=rewards[part],
        )
        for part in parts
        if part.start < part.stop
    ]
    try:
        for record in records:
            refuse_impossible(record)
    except (ValueError, IndexError) as error:
        raise RunError(f"{path}: runs do not fit their description ({error})") from error
    return records
