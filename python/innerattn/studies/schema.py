"""JSON Schema of a study's file, for editors that complete and check.

`python -m innerattn.studies.schema` writes the copy that is part of the package. Rules between keys
are checked only when a study is planned.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from innerattn.config.files import write_whole
from innerattn.config.schema import DIALECT, run_schema
from innerattn.studies.study import Study

COPY = Path(__file__).with_name("study.schema.json")


def study_schema() -> dict[str, Any]:
    """The schema of a file for `innerattn.studies.study.study_in`.

    The grid takes a list of values for each key of a run, a variant one value.
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
    varied = {name: _varied(section, run["$defs"]) for name, section in sections.items()}
    parts["Grid"] |= {"properties": {**parts["Grid"]["properties"], **varied}}
    for name in ("Variant", "Grid"):
        parts[name]["additionalProperties"] = False
    return {"$schema": DIALECT, **study, "title": "Study of innerattn", "$defs": parts}


def study_schema_text() -> str:
    """The schema as its copy holds it."""
    return json.dumps(study_schema(), indent=1) + "\n"


def _varied(section: dict[str, Any], parts: dict[str, Any]) -> dict[str, Any]:
    """A section of a run, with a list of values for each of its keys."""
    of = parts[section["$ref"].rpartition("/")[2]]
    properties = {}
    for key, value in of["properties"].items():
        if "$ref" in value:  # a section of a section
            properties[key] = _varied(value, parts)
        else:
            one = {word: given for word, given in value.items() if word != "default"}
            properties[key] = {"type": "array", "minItems": 1, "items": one}
    return {"type": "object", "additionalProperties": False, "properties": properties}


if __name__ == "__main__":
    write_whole(COPY, study_schema_text().encode())
    print(COPY)
