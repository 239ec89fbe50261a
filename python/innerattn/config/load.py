"""Makes a `RunConfig` from presets, a file and single values, and writes and reads it as TOML.

Later sources win: scenario preset or file, budget, what the algorithm changes in the budget, what
it changes after a warm start, configuration file, single values.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from innerattn.config.family import Family
from innerattn.config.files import (
    budget_table,
    preset_table,
    toml_table,
    toml_table_in,
    write_whole,
)
from innerattn.config.map_file import with_map_file
from innerattn.config.model import config_error
from innerattn.config.registry import methods
from innerattn.config.run import RunConfig
from innerattn.config.scenario import Scenario, scenario_table
from innerattn.errors import ConfigError

ANY = "any"
"""Name of the family that comes with the package."""
_CHOOSING = ("method", "warm_start")
"""Keys of the section `train` on which the values of a budget depend."""


def load_run_config(
    preset: str = "mixed",
    method: str = "td-inner",
    budget: str = "quick",
    config_file: str | Path | None = None,
    overrides: Mapping[str, object] | None = None,
    scenario_file: str | Path | None = None,
    family: str | Path | None = None,
) -> RunConfig:
    """The configuration of a run.

    Args:
        preset: name of a built-in scenario; without effect where ``scenario_file`` is given.
        method: value of `train.method`.
        budget: name of a built-in budget.
        config_file: TOML file with any of `RunConfig`'s sections and keys.
        overrides: values by dotted key, e.g. ``{"td.gamma": 0.99}``, or
            ``{"train.schedule.gamma": {"first": 0.9, "last": 0.99}}`` in a section's own section.
        scenario_file: TOML file as of `Scenario.from_toml`.
        family: "any" for the family of the package, or a TOML file with the keys of a
            `innerattn.config.family.Family`, at the top or in a section ``family``.

    Raises:
        ConfigError: unknown preset or key, value out of range, or values that contradict each
            other; the message names the key and what is allowed.
    """
    given: dict[str, Any] = {"train": {"method": method}}
    if config_file is not None:
        from_file = toml_table(config_file)
        if isinstance(section := from_file.get(Scenario.place), dict):
            from_file[Scenario.place] = with_map_file(section, config_file)
        if misplaced := [key for key in from_file if key in Scenario.model_fields]:
            raise ConfigError(
                f"{config_file}: {misplaced[0]}: unknown key; a scenario's stand in [scenario], "
                "or in a file for --scenario"
            )
        _merge(given, from_file)
    train = given["train"] if isinstance(given["train"], dict) else {}
    single = overrides or {}
    chosen = {name: single.get(f"train.{name}", train.get(name)) for name in _CHOOSING}
    scenario = preset_table("scenarios", preset)
    if scenario_file is not None:
        Scenario.from_toml(scenario_file)  # where the file is wrong by itself, the message names it
        scenario = scenario_table(scenario_file)
    table: dict[str, Any] = {"scenario": scenario}
    _merge(table, preset_table("budgets", budget))
    known = methods().get(str(chosen["method"]))
    if known is not None:
        _merge(table, budget_table(known.algorithm.budgets, budget))
        if chosen["warm_start"] not in (None, "none"):
            _merge(table, budget_table(known.algorithm.warm_budgets, budget))
    _merge(table, given)
    if family is not None:
        table["family"] = family_table(family)
    for key, value in single.items():
        _put(table, key, value)
    if config_file is None:
        return _validated(table)
    try:
        return _validated(table, "" if overrides else str(config_file))
    except ConfigError:
        if overrides:  # where the file is wrong by itself, the message names it
            load_run_config(
                preset, method, budget, config_file, scenario_file=scenario_file, family=family
            )
        raise


def family_table(family: str | Path) -> dict[str, Any]:
    """The keys of a family: none for "any", or those of a TOML file.

    Raises:
        ConfigError: the file cannot be read, or is wrong.
    """
    if str(family) == ANY:
        return {}
    table = toml_table(family)
    section = table.get(Family.place)
    if isinstance(section, dict):
        if others := [key for key in table if key != Family.place]:
            where = f"must stand in [{Family.place}], as the others do"
            raise ConfigError(f"{family}: {others[0]}: {where}")
        table = section
    try:
        Family.model_validate(table)
    except ValidationError as error:
        raise config_error(error, Family.place, str(family), Family) from error
    return table


def write_toml(config: RunConfig, path: str | Path) -> None:
    """Write ``config`` to ``path`` with all defaults; keys without a value are left out.

    The file appears whole or not at all.
    """
    write_whole(Path(path), tomli_w.dumps(config.model_dump(exclude_none=True)).encode())


def read_toml(path: str | Path) -> RunConfig:
    """The configuration in a file; `write_toml` and `read_toml` give the same one back.

    Raises:
        ConfigError: the file cannot be read, is not TOML, or holds no valid configuration.
    """
    return _validated(toml_table(path), str(path))


def config_in(data: bytes, path: str | Path) -> RunConfig:
    """The configuration in the bytes of the file at ``path``.

    Raises:
        ConfigError: as of `read_toml`.
    """
    return _validated(toml_table_in(data, path), str(path))


def _validated(table: dict[str, Any], source: str = "") -> RunConfig:
    try:
        return RunConfig.model_validate(table)
    except ValidationError as error:
        raise config_error(error, source=source, model=RunConfig) from error


def _put(table: dict[str, Any], key: str, value: object) -> None:
    """Put a value at a dotted key; a section may have sections, but no deeper ones."""
    *sections, name = key.split(".", 2)
    place: Any = table
    for section in sections:
        place = place.setdefault(section, {})
        if not isinstance(place, dict):
            break
    if not sections or not isinstance(place, dict):
        raise ConfigError(f"{key}: unknown key; keys are written SECTION.KEY")
    place[name] = value


def _merge(table: dict[str, Any], other: Mapping[str, Any]) -> None:
    """Put ``other`` into ``table``, section by section; a list replaces a list."""
    for key, value in other.items():
        if isinstance(value, Mapping) and isinstance(table.get(key), dict):
            _merge(table[key], value)
        else:
            table[key] = value
