"""The file that a scenario begins with: it says the defaults, and its examples are valid."""

import re
import tomllib
from pathlib import Path

import pytest

from innerattn.config import Scenario
from innerattn.config.new_scenario import new_scenario

EXAMPLE = re.compile(r"^#(?=\[\[|\w+ = )", re.MULTILINE)


def text() -> str:
    return new_scenario("flood", "flood.toml")


def test_it_is_the_default_scenario(tmp_path: Path) -> None:
    file = tmp_path / "flood.toml"
    file.write_text(text())
    assert Scenario.from_toml(file) == Scenario()


def test_every_key_stands_in_it_with_its_meaning() -> None:
    assert len(EXAMPLE.findall(text())) >= 12
    values = tomllib.loads(EXAMPLE.sub("", text()))
    assert values.keys() == Scenario.model_fields.keys()
    for info in Scenario.model_fields.values():
        first = (info.description or "").replace("None:", "left out:").split()[:4]
        assert f"# {' '.join(first)}" in text()
    assert max(map(len, text().splitlines())) <= 100


@pytest.mark.parametrize(
    "key",
    [
        "end_when_rescued",
        "victim_area_m",
        "victim_places_m",
        "communication",
        "observed_teammates",
        "observed_victims",
        "start_m",
        "obstacles",
        "faults",
        "deadline_s",
        "area_m",
    ],
)
def test_each_example_may_be_used(key: str, tmp_path: Path) -> None:
    lines, inside = [], False
    for line in text().splitlines():
        inside = line.startswith((f"#{key} = ", f"#[[{key}]]")) or (inside and line[:1] == "#")
        lines.append(EXAMPLE.sub("", line) if inside else line)
    file = tmp_path / "flood.toml"
    file.write_text("\n".join(lines))
    scenario = Scenario.from_toml(file)
    assert scenario != Scenario()
    parts = {"start_m": scenario.robots, "deadline_s": scenario.tasks, "area_m": scenario.tasks}
    (first, *_) = parts.get(key, (scenario,))
    assert getattr(first, key)
