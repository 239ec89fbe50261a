"""JSON Schema of a study's file, for editors that complete and check.

`python -m innerattn.studies.schema` writes the copy that is part of the package. Rules between keys
are checked only when a study is planned.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from innerattn.config.files import write_whole
from innerattn.config.schema import DIALECT, run_schema
from innerattn.studies.space import Range
from innerattn.studies.study import Study

COPY = Path(__file__).with_name("study.schema.json")


def study_schema() -> dict[str, Any]:
    """The schema of a file for `innerattn.studies.study.study_in`.

    The grid takes a list of values for each key of a run, a variant one value, a search a list or a
    range.
    """
    study, run = Study.model_json_schema(), run_schema()
    parts = study.pop("$defs")
    grids = study["properties"]["grid"]
    study["properties"]["grid"] = {
        "description": grids.pop("description"),
        "anyOf": [grids["items"], grids],
    }
    sections = run["properties"]
    parts |= run["$defs"]
    parts["Variant"] |= {"properties": {**parts["Variant"]["properties"], **sections}}
    parts["Range"] = Range.model_json_schema()
    for part, of_key in (("Grid", _list_of), ("Search", _list_or_range)):
        varied = {name: _varied(one, run["$defs"], of_key) for name, one in sections.items()}
        parts[part] |= {"properties": {**parts[part]["properties"], **varied}}
    for name in ("Variant", "Grid", "Search"):
        parts[name]["additionalProperties"] = False
    return {"$schema": DIALECT, **study, "title": "Study of innerattn", "$defs": parts}


def study_schema_text() -> str:
    """The schema as its copy holds it."""
    return json.dumps(study_schema(), indent=1) + "\n"


def _varied(
    section: dict[str, Any], parts: dict[str, Any], of_key: Callable[[dict[str, Any]], Any]
) -> dict[str, Any]:
    """A section of a run, with something made of the schema of each of its keys."""
    one = section if "$ref" in section else section["anyOf"][0]  # or none at all
    of = parts[one["$ref"].rpartition("/")[2]]
    properties = {}
    for key, value in of["properties"].items():
        if "$ref" in value:  # a section of a section
            properties[key] = _varied(value, parts, of_key)
        else:
            properties[key] = of_key({k: given for k, given in value.items() if k != "default"})
    return {"type": "object", "additionalProperties": False, "properties": properties}


def _list_of(value: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "minItems": 1, "items": value}


def _list_or_range(value: dict[str, Any]) -> dict[str, Any]:
    values = {"type": "array", "minItems": 2, "items": value}
    numbers = {value.get("type"), *(one.get("type") for one in value.get("anyOf", ()))}
    if not numbers & {"integer", "number"}:
        return values
    return {"anyOf": [values, {"$ref": "#/$defs/Range"}]}


if __name__ == "__main__":
    write_whole(COPY, study_schema_text().encode())
    print(COPY)
