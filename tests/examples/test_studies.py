"""The example studies: each asks something, can be planned, and has as many runs as it says."""

import re
import runpy
from pathlib import Path

import pytest

from innerattn.config import Scenario
from innerattn.studies.plan import plan_study
from innerattn.studies.study import study_in

STUDIES = Path(__file__).parents[2] / "examples" / "studies"
FILES = sorted(one.name for one in STUDIES.glob("*.toml") if one.name != "search.toml")
NUMBERS = {"Twelve": 12, "Thirty": 30}
TEAMS = runpy.run_path(str(STUDIES / "short_sight" / "teams.py"))


@pytest.mark.parametrize("name", FILES)
def test_a_study_has_as_many_runs_as_it_says(name: str) -> None:
    text = (STUDIES / name).read_text("utf-8")
    study = study_in(text.encode(), name)
    assert study.question
    said = re.search(r"^# (\w+) runs", text, re.MULTILINE)
    assert said is not None
    number = NUMBERS.get(said[1]) or int(said[1])
    assert len(plan_study(study, STUDIES.joinpath)) == number


@pytest.mark.parametrize("size", TEAMS["SIZES"])
@pytest.mark.parametrize("sight", TEAMS["SIGHTS"])
def test_worlds_of_short_sight_are_as_the_program_writes_them(size: int, sight: int) -> None:
    file = STUDIES / "short_sight" / f"team_{size}_sight_{sight}.toml"
    assert file.read_text("utf-8") == TEAMS["world"](size, sight)
    scenario = Scenario.from_toml(file)
    assert len(scenario.robots) == size
    for one in scenario.robots:
        assert one.sight_m == pytest.approx(sight * 2 * one.radius_m)
    arena_m2 = (2 * scenario.arena_half_width_m) ** 2
    assert arena_m2 / size == pytest.approx(1.0, rel=0.01)
