"""Colours: each is written once, and those of robots are the same in pages and figures."""

import re
from importlib.resources import files
from pathlib import Path

from innerattn.config import Scenario
from innerattn.envs.colours import KIND_COLOURS, robot_looks

REPORT = Path(str(files("innerattn.report")))


def test_pages_take_all_colours_from_one_file() -> None:
    pages = [path for path in REPORT.rglob("web/*.css") if path.name != "colours.css"]
    assert len(pages) >= 5
    for path in pages:
        assert not re.findall(r"#[0-9a-f]{3,8}\b", path.read_text("utf-8")), path


def test_figures_have_the_colours_of_pages() -> None:
    light = (REPORT / "web" / "colours.css").read_text("utf-8").split("[data-theme", 1)[0]
    found = dict(re.findall(r"--(kind-\d): (#[0-9a-f]{6})", light))
    assert found == {f"kind-{kind}": colour.lower() for kind, colour in enumerate(KIND_COLOURS)}


def test_a_kind_has_a_colour_and_its_robots_are_told_apart_as_twins() -> None:
    looks = robot_looks(robot.kind for robot in Scenario.preset("mixed").robots)
    assert [(look.kind, look.twin) for look in looks] == [(0, 0), (0, 1), (1, 0), (2, 0)]
    assert [look.colour for look in looks] == [KIND_COLOURS[kind] for kind in (0, 0, 1, 2)]
