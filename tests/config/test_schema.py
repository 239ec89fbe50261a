"""The JSON Schemas: the copies are those of the models, and take what the models take."""

import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from innerattn.config import (
    Arrival,
    Fault,
    Obstacle,
    Robot,
    Scenario,
    Task,
    load_run_config,
    write_toml,
)
from innerattn.config.files import PRESETS
from innerattn.config.model import Told
from innerattn.config.schema import COPIES, SCHEMAS, schema_text, write_copies

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
from reference_directives import value_of

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


@pytest.mark.long
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


# A key of each part of a scenario whose range the compiled module checks, with what it stands in.
TOLD = [
    (part, name)
    for part, model in (("", Scenario), ("robots", Robot), ("tasks", Task), ("faults", Fault))
    for name, field in model.model_fields.items()
    if any(isinstance(one, Told) for one in field.metadata)
    and name != "victim_places_m"  # at least as many as there may be victims
]


@pytest.mark.parametrize(("part", "name"), TOLD)
def test_ranges_are_those_that_the_compiled_module_checks(part: str, name: str) -> None:
    scenario = Scenario.preset("mixed-faults").model_dump(mode="json")
    model = {"": Scenario, "robots": Robot, "tasks": Task, "faults": Fault}[part]
    key = model.model_json_schema()["properties"][name]
    (key,) = (one for one in key.get("anyOf", [key]) if one["type"] != "null")
    of_list = key["type"] == "array"
    low, high = (
        key[end] for end in (("minItems", "maxItems") if of_list else ("minimum", "maximum"))
    )
    holder = scenario[part][0] if part else scenario
    arrival = {"at_s": 1.0, "task": "task_1", "position_m": [0.5, 0.5]}
    station = {"position_m": [0.5, 0.5], "recharge_w": 5.0}
    others = {"arrivals": arrival, "stations": station, "depots": {"position_m": [0.5, 0.5]}}
    absent = others.get(name, {"shape": "disc", "radius_m": 0.05})
    some = [*(holder[name] or [absent])][:1] if of_list else []
    beyond = [high + 1, low - 1] if of_list or key["type"] == "integer" else [1.1 * high, low - 1.0]
    for value in beyond:
        if value < 0 and (of_list or key["type"] == "integer"):
            continue  # no such length, and no such count
        holder[name] = some * int(value) if of_list else value
        with pytest.raises(ValueError, match=r"must be in \S+\.\.=\S+") as refusal:
            Scenario.model_validate_json(json.dumps(scenario))
        (ends,) = re.findall(r"must be in (\S+?)\.\.=([\d.e]+)", str(refusal.value))
        assert tuple(map(float, ends)) == (low, high)


def test_every_number_of_a_scenario_has_a_range() -> None:
    """None is left out of the reference; places and sizes depend on the arena."""
    free = {
        "start_m",
        "half_extents_m",
        "position_m",
        "victim_area_m",
        "radius_m",
        "onset_step",
        "value",
    }
    for model in (Scenario, Robot, Task, Arrival, Obstacle, Fault):
        for name, key in model.model_json_schema()["properties"].items():
            kinds = [
                one for one in key.get("anyOf", [key]) if one.get("type") in ("number", "integer")
            ]
            assert all("maximum" in one for one in kinds) or name in free, (model, name)


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ({"type": "number", "minimum": 0.0, "maximum": 1.0}, "number, 0 to 1"),
        ({"type": "number", "exclusiveMinimum": 0.0, "maximum": 1.0}, "number, above 0 to 1"),
        ({"type": "number", "minimum": 0.0, "exclusiveMaximum": 1.0}, "number, 0 to below 1"),
        ({"type": "integer", "minimum": 1, "maximum": 1_000_000}, "integer, 1 to 1,000,000"),
        ({"type": "integer", "minimum": 0, "exclusiveMaximum": 2**32}, "integer, at least 0"),
        ({"type": "integer", "minimum": 0, "exclusiveMaximum": 2**63}, "integer, 0 to below 2**63"),
        ({"type": "number", "minimum": 0.001, "maximum": 1e5}, "number, 0.001 to 100,000"),
        ({"type": "number", "minimum": 1e-6}, "number, at least 0.000001"),
        ({"type": "number", "exclusiveMinimum": 0}, "number, above 0"),
        ({"type": "number"}, "number"),
        (
            {"type": "array", "items": {"type": "string"}, "minItems": 1, "maxItems": 8},
            "list of string (1 to 8)",
        ),
        (
            {"anyOf": [{"type": "number", "minimum": 1}, {"type": "null"}]},
            "number, at least 1 or none",
        ),
    ],
)
def test_the_reference_writes_ranges_in_one_way(key: dict[str, Any], text: str) -> None:
    assert value_of(key, {}) == text


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
