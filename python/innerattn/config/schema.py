"""JSON Schemas of the scenario's file and of the run's file, for editors that complete and check.

They tell keys, types, words, ranges and defaults. Rules between keys are checked only when a file
is loaded. `python -m innerattn.config.schema` writes the copies that are
part of the package.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, create_model

from innerattn.config.files import write_whole
from innerattn.config.registry import algorithms
from innerattn.config.run import RunConfig
from innerattn.config.scenario import Scenario

COPIES = Path(__file__).parent / "schemas"
"""Folder of the copies, ``NAME.schema.json``."""

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """The schema of a file as of `Scenario.from_toml`, in both its forms."""
    scenario = Scenario.model_json_schema()
    parts = {**scenario.pop("$defs"), "Scenario": scenario}
    section = {
        "type": "object",
        "required": ["scenario"],
        "properties": {"scenario": {"$ref": "#/$defs/Scenario"}},
    }
    forms = [{"$ref": "#/$defs/Scenario"}, section]
    return {"$schema": DIALECT, "title": "Scenario of innerattn", "anyOf": forms, "$defs": parts}


def run_schema() -> dict[str, Any]:
    """The schema of a file for `load_run_config`, with sections of all registered algorithms."""
    others: dict[str, Any] = {
        name: (algorithm.config, ...)
        for name, algorithm in algorithms().items()
        if name not in RunConfig.model_fields
    }
    run: type[BaseModel] = create_model("Run", __base__=RunConfig, **others)
    schema = run.model_json_schema()
    for key in ("required", "description"):
        schema.pop(key, None)
    schema["additionalProperties"] = False
    return {"$schema": DIALECT, **schema, "title": "Run of innerattn"}


SCHEMAS: Mapping[str, Callable[[], dict[str, Any]]] = {
    "run": run_schema,
    "scenario": scenario_schema,
}
"""What makes each schema, by the name of the file that it describes."""


def schema_text(name: str) -> str:
    """The schema ``name`` of `SCHEMAS` as JSON, as its copy holds it."""
    return json.dumps(SCHEMAS[name](), indent=1) + "\n"


def write_copies(folder: Path = COPIES) -> list[Path]:
    """Write all schemas into ``folder``, which is made where it is missing.

    Returns:
        The files.

    Raises:
        OSError: they cannot be written.
    """
    folder.mkdir(exist_ok=True)
    files = [folder / f"{name}.schema.json" for name in SCHEMAS]
    for name, file in zip(SCHEMAS, files, strict=True):
        write_whole(file, schema_text(name).encode())
    return files


if __name__ == "__main__":
    for written in write_copies():
        print(written)
