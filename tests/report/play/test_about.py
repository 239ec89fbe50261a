"""The sentences at the top of the page to play with: what there is to know of worlds."""

import json
from importlib.resources import files
from pathlib import Path

import pytest
from in_node import run_in_node

from innerattn.config import Scenario
from innerattn.report.play.state import playable_worlds

SCENARIOS = Path(__file__).parents[3] / "examples" / "scenarios"
REPORT = files("innerattn.report")
SCRIPTS = [
    REPORT / "web" / "worlds.js",
    REPORT / "web" / "story.js",
    REPORT / "play" / "web" / "about.js",
]

ADDED = "What the robots there offer is added up."
SERVICE = "Help takes time: robots stay until the arc around the victim is closed."
ORDER = "Dashed victims wait: panel for frame and check for frame and panel."
LOST = "A victim is lost when the seconds below it are over."
BATTERIES = "Some robots run on batteries, which stations charge."
SIGHT = "Robots see only a part of the arena: the pale area around the chosen one."
ONE_SEES = "Some robots see only a part of the arena: the pale area around the chosen one."
WHEELS = "Robots with a nose are on wheels: they turn before they drive on."
RULES = {
    "assembly": [ORDER],
    "convoy": [WHEELS],
    "drones": [SIGHT],
    "fire": [ADDED],
    "flood": [LOST],
    "lookout": [ONE_SEES],
    "office": [],
    "rovers": [SIGHT, WHEELS],
    "search": [],
    "warehouse": [SERVICE, BATTERIES],
}
NEEDS = {
    "assembly": "lift and carry (frame) or carry and carry (panel) or inspect (check)",
    "fire": "1.8 water (small_fire) or 3 water and 1 view (large_fire)",
    "lookout": "food (hungry)",
}


def about(scenario: Scenario) -> str:
    """What the page says of worlds in which one policy without attention acts."""
    worlds = json.dumps(playable_worlds(scenario))
    code = "\n".join(script.read_text("utf-8") for script in SCRIPTS)
    code += f"\nprocess.stdout.write(aboutText({worlds}, false, false));"
    return run_in_node(code).decode()


def test_there_is_a_row_for_each_worked_scenario() -> None:
    assert set(RULES) == {file.stem for file in SCENARIOS.glob("*.toml")}


@pytest.mark.parametrize("name", RULES)
def test_it_says_what_victims_need_and_what_else_holds(name: str) -> None:
    scenario = Scenario.from_toml(SCENARIOS / f"{name}.toml")
    text = about(scenario)
    assert text.startswith(f"{scenario.num_robots} robots rescue victims. A victim is rescued ")
    assert f"beside it at the same time: {NEEDS.get(name, '')}" in text
    for task in scenario.tasks:
        assert f"({task.name})" in text
    rules = text.partition(". ")[2].partition(". ")[2].partition("Each robot acts by itself")[0]
    assert rules.strip() == " ".join(RULES[name])


def test_plain_worlds_have_no_further_rules() -> None:
    text = about(Scenario.preset("mixed"))
    assert "(task_2). Each robot acts by itself." in text


def test_what_is_carried_is_used_up() -> None:
    scenario = Scenario.preset("mixed")
    first, *others = scenario.robots
    loaded = scenario.replace(robots=(first.replace(load=2), *others))
    assert "Some robots use up what they carry. " in about(loaded)
