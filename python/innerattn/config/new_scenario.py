"""A scenario file to begin with: every key with its meaning and default, as commented TOML."""

from __future__ import annotations

import json
import textwrap
from typing import Any

from pydantic import BaseModel

from innerattn.config.scenario import Scenario

_WIDTH = 100
_HEAD = """\
# The rescue world {name}, with the team and the tasks of the preset mixed.
#
#   innerattn info --scenario {file}     checks and draws it
#   innerattn train --scenario {file}    trains a team in it
#
# Every key may be left out. A line that begins with # and a key is an example: remove the # to use
# it. docs/scenario.md has ranges and rules.
"""
_EXAMPLES: dict[str, Any] = {
    "end_when_rescued": 10,
    "observed_teammates": 2,
    "observed_victims": 1,
    "victim_area_m": [-0.5, -0.5, 0.5, 0.5],
    "victim_places_m": [[0.5, 0.5], [-0.5, 0.5], [0.0, -0.5]],
    "communication": {"range_m": 0.8, "delay_steps": 2},
    "map": {"rows": ["....", ".##.", ".#..", "...."]},
}
_OF_TABLES: dict[str, dict[str, Any]] = {
    "robots": {"start_m": [-0.5, 0.0]},
    "tasks": {"deadline_s": [10.0, 20.0], "area_m": [-0.9, -0.9, 0.0, 0.9]},
}
_TABLES: dict[str, dict[str, Any]] = {
    "arrivals": {"at_s": 2.0, "task": "task_1", "position_m": [0.5, 0.5]},
    "obstacles": {
        "shape": "box",
        "half_extents_m": [0.3, 0.05],
        "position_m": [0.0, 0.4],
        "layers": ["ground"],
    },
    "faults": {"robot": "food_0", "kind": "motor_gain", "value": 0.3, "onset_step": 10},
}
"""Values of keys, and tables, that are not there by default."""


def new_scenario(name: str, file: str) -> str:
    """The text of a scenario file with all defaults; `Scenario.from_toml` reads it.

    Args:
        name: what the head of the file calls the world.
        file: the name of the file, for the commands in its head.
    """
    default = Scenario()
    plain, tables = [], []
    for key, info in Scenario.model_fields.items():
        value, comment = getattr(default, key), _comment(info.description or "", "# ")
        if isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            first, *others = (one.model_dump(mode="json", exclude_none=True) for one in value)
            example = "".join(f"#{_line(*one)}" for one in _OF_TABLES[key].items())
            team = [_table(key, first) + example, *(_table(key, one) for one in others)]
            tables.append(comment + _keys(type(value[0])) + "\n".join(team))
        elif key in _TABLES:
            lines = _table(key, _TABLES[key]).splitlines()
            tables.append(comment + "".join(f"#{line}\n" for line in lines))
        elif key in _EXAMPLES:
            plain.append(f"{comment}#{_line(key, _EXAMPLES[key])}")
        else:
            plain.append(comment + _line(key, value))
    return "\n".join([_HEAD.format(name=name, file=file), *plain, *tables])


def _comment(text: str, indent: str) -> str:
    text = text.replace("None:", "left out:")
    return textwrap.fill(text, _WIDTH, initial_indent=indent, subsequent_indent=indent) + "\n"


def _keys(model: type[BaseModel]) -> str:
    """What each key of a table means."""
    lines = (f"{key}: {info.description}" for key, info in model.model_fields.items())
    return "".join(_comment(line, "#   ") for line in lines)


def _table(key: str, values: dict[str, Any]) -> str:
    return f"[[{key}]]\n" + "".join(_line(name, value) for name, value in values.items())


def _line(key: str, value: Any) -> str:
    """A key of a TOML file; numbers, words and lists of them are written as in JSON."""
    if isinstance(value, dict):
        inner = ", ".join(_line(name, one).rstrip() for name, one in value.items())
        return f"{key} = {{ {inner} }}\n"
    return f"{key} = {json.dumps(value)}\n"
