"""Reads JSON files of instances: lists of objects with the keys of one of the two models."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from innerattn.config.instances.instance import NAME, Instance
from innerattn.config.instances.world import WorldInstance
from innerattn.config.model import config_error
from innerattn.config.near import did_you_mean
from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import ConfigError, RunError

SHIPPED: Mapping[str, str] = {"ral": "ral_00_29.json", "standard": "standard.json"}
"""Sets of instances that come with the package, and their files."""

Sort = TypeVar("Sort", Instance, WorldInstance)
Instances = tuple[Instance, ...] | tuple[WorldInstance, ...]


def read_any(source: str | Path) -> Instances:
    """The instances in a JSON file, or in a set of `SHIPPED`, of either sort.

    Raises:
        ConfigError: there is no such file, or it is not such a list of one sort; the message names
            the file, the instance, and the robot or task.
    """
    if str(source) not in SHIPPED:
        return _read(Path(source), str(source))
    with as_file(files(__package__) / SHIPPED[str(source)]) as path:
        return _read(path, str(source))


def read_instances(source: str | Path) -> tuple[Instance, ...]:
    """The instances of task allocation in a JSON file, or in a set of `SHIPPED`.

    Raises:
        ConfigError: as of `read_any`, or they are worlds.
    """
    found = read_any(source)
    kept = tuple(one for one in found if isinstance(one, Instance))
    if not kept:
        raise ConfigError(f"{source}: has worlds, and no instances of task allocation")
    return kept


def read_worlds(source: str | Path) -> tuple[WorldInstance, ...]:
    """The worlds in a JSON file, or in a set of `SHIPPED`.

    Raises:
        ConfigError: as of `read_any`, or they are instances of task allocation.
    """
    found = read_any(source)
    kept = tuple(one for one in found if isinstance(one, WorldInstance))
    if not kept:
        raise ConfigError(f"{source}: has instances of task allocation, and no worlds")
    return kept


def named_instance(written: str) -> Instance | WorldInstance:
    """The instance that `FILE:NAME` means, or `FILE` alone: the first of the file.

    Raises:
        ConfigError: as of `read_any`, or there is none of this name.
    """
    source, _, name = written.rpartition(":")
    if not source or Path(written).exists():
        return read_any(written)[0]
    instances = {instance.name: instance for instance in read_any(source)}
    if name not in instances:
        near = did_you_mean(name, instances, repr)
        raise ConfigError(f"{source}: no instance is named {name!r}{near}")
    return instances[name]


def _read(path: Path, shown: str) -> Instances:
    try:
        entries = parse_json(read_plain(path, MOST_JSON_BYTES, follow_link=True))
    except RunError as error:
        raise ConfigError(f"{error}{did_you_mean(shown, SHIPPED, repr)}") from error
    except OSError as error:
        raise ConfigError(f"cannot read {shown}: {error.strerror}") from error
    except ValueError as error:
        raise ConfigError(f"{shown}: is not a JSON file: {error}") from error
    if not isinstance(entries, list) or not entries:
        raise ConfigError(f"{shown}: must be a list of one instance or more")
    if isinstance(entries[0], dict) and "scenario" in entries[0]:
        return _all(WorldInstance, entries, shown)
    return _all(Instance, entries, shown)


def _all(sort: type[Sort], entries: list[Any], shown: str) -> tuple[Sort, ...]:
    instances = tuple(_instance(sort, entry, index, shown) for index, entry in enumerate(entries))
    names = Counter(instance.name for instance in instances)
    name, count = names.most_common(1)[0]
    if count > 1:
        raise ConfigError(f"{shown}: the name {name!r} comes {count} times")
    return instances


def _instance(sort: type[Sort], entry: Any, index: int, shown: str) -> Sort:
    name = entry.get("name") if isinstance(entry, dict) else None
    named = isinstance(name, str) and re.fullmatch(NAME, name)
    root = str(name) if named else f"instances[{index}]"
    try:
        return sort.model_validate(entry)
    except ValidationError as error:
        told = str(config_error(error, root, model=sort))
        if not told.startswith(
            (f"{root}.", f"{root} ", f"{root}:")
        ):  # a rule of the scenario's own
            told = f"{root}.{told}"
        raise ConfigError(f"{shown}: {told}") from error
