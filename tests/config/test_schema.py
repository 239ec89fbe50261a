"""The JSON Schemas: the copies are those of the models, and take what the models take."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from innerattn.config import Scenario, load_run_config, write_toml
from innerattn.config.files import PRESETS
from innerattn.config.schema import COPIES, SCHEMAS, schema_text, write_copies

SCENARIO_FILES = sorted(Path(str(PRESETS)).glob("scenarios/*.toml"))
BUDGET_FILES = sorted(Path(str(PRESETS)).glob("budgets/**/*.toml"))


def validator(name: str) -> Draft202012Validator:
    schema = json.loads((COPIES / f"{name}.schema.json").read_text("utf-8"))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def table(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text("utf-8"))


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_copies_are_what_the_models_give(name: str, tmp_path: Path) -> None:
    copy = (COPIES / f"{name}.schema.json").read_text("utf-8")
    assert copy == schema_text(name), "python -m innerattn.config.schema writes it"
    assert [file.name for file in write_copies(tmp_path / "new")] == [
        f"{one}.schema.json" for one in SCHEMAS
    ]


@pytest.mark.parametrize("path", SCENARIO_FILES, ids=lambda path: path.stem)
def test_scenario_presets_are_valid_in_both_forms(path: Path) -> None:
    validator("scenario").validate(table(path))
    validator("scenario").validate({"scenario": table(path), "td": {"gamma": 0.9}})
    validator("run").validate({"scenario": table(path)})


@pytest.mark.parametrize("path", BUDGET_FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_budgets_are_valid(path: Path) -> None:
    validator("run").validate(table(path))


def test_a_whole_run_is_valid(tmp_path: Path) -> None:
    write_toml(load_run_config("mixed-faults", "ppo-inner", "fast"), tmp_path / "config.toml")
    validator("run").validate(table(tmp_path / "config.toml"))


@pytest.mark.parametrize(
    ("name", "document"),
    [
        ("scenario", {"situaton": "mixed"}),
        ("scenario", {"situation": "mxied"}),
        ("scenario", {"scenario": {"situation": "mxied"}}),
        ("scenario", {"robots": [{"name": "a"}]}),
        ("scenario", {"episode_steps": "25"}),
        ("run", {"trian": {}}),
        ("run", {"train": {"sede": 1}}),
        ("run", {"td": {"gamma": 2.0}}),
    ],
)
def test_what_is_wrong_is_refused(name: str, document: dict[str, Any]) -> None:
    assert not validator(name).is_valid(document)


def test_words_are_offered_and_other_words_are_not_refused() -> None:
    run = validator("run")
    (words,) = [
        one["enum"]
        for one in run.schema["$defs"]["TrainConfig"]["properties"]["method"]["anyOf"]
        if "enum" in one
    ]
    assert "td-inner" in words
    assert run.is_valid({"train": {"method": "walk-inner"}})  # of an extension


def test_every_key_of_a_scenario_is_there() -> None:
    found = validator("scenario").schema["$defs"]["Scenario"]["properties"]
    assert found.keys() == Scenario.model_fields.keys()
