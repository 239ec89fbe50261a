"""The worlds of the study of crowds: as their program writes them, and groups of three apart."""

import runpy
from pathlib import Path

import pytest

from innerattn.config import Scenario
from innerattn.evaluate import run_episodes, scripted_policy

CROWD = Path(__file__).parents[2] / "examples" / "studies" / "crowd"
SITES = runpy.run_path(str(CROWD / "sites.py"))


@pytest.mark.parametrize("sites", SITES["SITES"])
def test_worlds_are_as_the_program_writes_them(sites: int) -> None:
    assert (CROWD / f"crowd_{3 * sites}.toml").read_text() == SITES["world"](sites)


def test_a_greedy_robot_works_with_the_two_of_its_site_alone() -> None:
    scenario = Scenario.from_toml(CROWD / "crowd_15.toml")
    record = run_episodes(scripted_policy("greedy", scenario), scenario, 8, 0)
    helpers = [record.rescues[f"helper_{k}"] // 3 for k in range(3)]
    assert len(record.rescues) > 8 * 5
    for site in helpers:
        assert (site == record.rescues["task"]).all()
