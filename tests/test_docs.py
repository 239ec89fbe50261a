"""The documentation names everything that it should."""

from pathlib import Path

from innerattn.config import Scenario

ROOT = Path(__file__).parents[1]


def test_the_scenario_reference_names_every_key() -> None:
    text = (ROOT / "docs" / "scenario.md").read_text("utf-8")
    parts = ("robots", "tasks", "obstacles", "faults")
    nested = [name for part in parts for name in _fields_of(part)]
    missing = [name for name in [*Scenario.model_fields, *nested] if f"`{name}" not in text]
    assert not missing


def _fields_of(part: str) -> list[str]:
    (model, *_) = Scenario.model_fields[part].annotation.__args__
    return list(model.model_fields)
