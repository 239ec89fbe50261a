"""The scenario model: presets, defaults, files, and errors that name the key."""

import copy
import json
import math
import pickle
from collections import Counter
from pathlib import Path

import pytest
import tomli_w
from pydantic import ValidationError

from innerattn import _core
from innerattn.config import SCENARIOS, Obstacle, Robot, Scenario, Task
from innerattn.errors import ConfigError


def test_default_team_is_table_one() -> None:
    team = [(r.name, r.kind, r.abilities, r.max_speed_mps, r.mass_kg) for r in Scenario().robots]
    assert team == [
        ("food_0", "food", ("food",), 1.0, 1.0),
        ("food_1", "food", ("food",), 1.0, 1.0),
        ("navigation_0", "navigation", ("information",), 1.5, 0.5),
        ("medical_0", "medical", ("medicine",), 1.5, 0.5),
    ]
    assert [(t.name, t.needs) for t in Scenario().tasks] == [
        ("task_1", ("food", "medicine")),
        ("task_2", ("food", "information")),
    ]


def test_defaults_are_the_compiled_ones() -> None:
    assert json.loads(_core.Rules("{}").to_json()) == Scenario().model_dump(mode="json")


@pytest.mark.parametrize(("name", "victims"), [("single", 1), ("double", 2), ("mixed", 2)])
def test_presets(name: str, victims: int) -> None:
    scenario = Scenario.preset(name)
    assert scenario.situation == name
    assert (scenario.num_robots, scenario.num_victims) == (4, victims)


def test_preset_names_are_complete() -> None:
    teams = {"mixed-1-food": 3, "mixed-4-food": 6, "mixed-8": 8, "mixed-16": 16}
    teams |= {"rescue-16": 16, "rescue-64": 64}
    others = {"mixed-faults", "mixed-radio", "mixed-sight", "mixed-wheels", "air-ground"}
    assert set(SCENARIOS) == {"single", "double", "mixed", *others, *teams}
    assert {name: Scenario.preset(name).num_robots for name in teams} == teams


@pytest.mark.parametrize("robots", [16, 64])
def test_the_work_of_a_rescue_preset_grows_with_its_team(robots: int) -> None:
    small, large = Scenario.preset("mixed"), Scenario.preset(f"rescue-{robots}")
    times = robots // small.num_robots
    kinds = Counter(robot.kind for robot in small.robots)
    assert Counter(robot.kind for robot in large.robots) == {k: times * n for k, n in kinds.items()}
    assert large.num_victims == times * small.num_victims
    assert large.arena_half_width_m**2 == times * small.arena_half_width_m**2
    bodies = {(one.kind, one.abilities, one.max_speed_mps, one.mass_kg) for one in small.robots}
    assert bodies == {
        (one.kind, one.abilities, one.max_speed_mps, one.mass_kg) for one in large.robots
    }


def test_the_preset_with_faults_is_mixed_with_faults_that_come_in_most_episodes() -> None:
    scenario = Scenario.preset("mixed-faults")
    assert scenario.replace(faults=()) == Scenario.preset("mixed")
    rates = [fault.onset_rate_hz or 0.0 for fault in scenario.faults]
    onsets = sum(rates) * scenario.episode_steps * scenario.dt_s
    assert 1 - math.exp(-onsets) == pytest.approx(0.6, abs=0.01)
    assert {fault.robot for fault in scenario.faults} == {r.name for r in scenario.robots}


def test_victim_slots_follow_the_situation() -> None:
    tasks = (*Scenario().tasks, Task(name="task_3", needs=("medicine",)))
    slots = {
        situation: Scenario(situation=situation, tasks=tasks, max_victims=5).num_victims
        for situation in ("single", "double", "mixed")
    }
    assert slots == {"single": 1, "double": 3, "mixed": 5}


@pytest.mark.parametrize("name", ["quick", "Mixed", "", "../scenario"])
def test_unknown_preset_names_the_known(name: str) -> None:
    with pytest.raises(ConfigError, match=r"double, mixed, .*single"):
        Scenario.preset(name)


def test_from_toml_reads_what_was_dumped(tmp_path: Path) -> None:
    scenario = Scenario(
        situation="double",
        robots=(
            Robot(name="a", kind="any", abilities=("x", "y"), max_speed_mps=1.0, mass_kg=2.0),
            Robot(name="b", kind="any", abilities=("x",), max_speed_mps=0.5, mass_kg=2.5),
        ),
        tasks=(Task(name="t", needs=("x", "x")),),
        obstacles=(
            Obstacle(shape="disc", radius_m=0.1),
            Obstacle(shape="box", half_extents_m=(0.1, 0.2), position_m=(-0.5, 0.5)),
        ),
        end_when_rescued=3,
    )
    file = tmp_path / "scenario.toml"
    file.write_text(tomli_w.dumps(scenario.model_dump(exclude_none=True)))
    assert Scenario.from_toml(file) == scenario


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("colour = 1", r"scenario\.colour: unknown key"),
        ("dt_s = 'x'", r"scenario\.dt_s = 'x': must be a valid number"),
        ("situation = 'triple'", r"scenario\.situation = 'triple': must be 'single', 'double'"),
        ("[[robots]]\nname = 'a'", r"scenario\.robots\[0\]\.kind: must be given"),
        ("episode_steps = 0", r"scenario\.episode_steps = 0: must be"),
        ("max_victims = -1", r"scenario\.max_victims = -1: must be"),
        ("end_when_rescued = 4294967296", r"scenario\.end_when_rescued = 4294967296: must be"),
        ("rescue_radius_m = nan", r"scenario\.rescue_radius_m = nan: must be a finite number"),
        ("dt_s = ", r"not a TOML file"),
    ],
)
def test_wrong_file_names_file_and_key(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        Scenario.from_toml(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"cannot read .*none\.toml: No such file"):
        Scenario.from_toml(tmp_path / "none.toml")


def test_wrong_values_are_refused_at_construction() -> None:
    with pytest.raises(ValidationError, match=r"scenario\.episode_steps = 0"):
        Scenario(episode_steps=0)
    heavy = Scenario().robots[0].model_copy(update={"mass_kg": -1.0})
    with pytest.raises(ValidationError, match=r"scenario\.robots\[0\]\.mass_kg = -1"):
        Scenario(robots=(heavy, *Scenario().robots[1:]))


def test_replace_changes_and_checks() -> None:
    scenario = Scenario.preset("single").replace(episode_steps=100)
    assert scenario == Scenario(situation="single", episode_steps=100)
    with pytest.raises(ConfigError, match=r"scenario\.episode_steps = 0"):
        scenario.replace(episode_steps=0)
    with pytest.raises(ConfigError, match=r"scenario\.colour: unknown key"):
        scenario.replace(colour=1)


def test_every_copy_keeps_what_the_check_returned() -> None:
    scenario = Scenario.preset("mixed-faults")
    copies = {
        "pickle": pickle.loads(pickle.dumps(scenario)),
        "copy": copy.copy(scenario),
        "deepcopy": copy.deepcopy(scenario),
        "model_copy": scenario.model_copy(),
        "deep model_copy": scenario.model_copy(deep=True),
        "dump": Scenario.model_validate(scenario.model_dump()),
        "JSON": Scenario.model_validate_json(scenario.model_dump_json()),
        "construct": Scenario.model_construct(**dict(scenario)),
    }
    for way, other in copies.items():
        assert other == scenario, way
        assert hash(other) == hash(scenario), way
        assert json.loads(other.rules.to_json()) == scenario.model_dump(mode="json"), way


def test_a_changed_copy_is_checked_anew() -> None:
    scenario = Scenario()
    changed = scenario.model_copy(update={"substeps": 3})
    assert changed == Scenario(substeps=3) != scenario
    assert json.loads(changed.rules.to_json())["substeps"] == 3
    assert changed.rules == Scenario(substeps=3).rules != scenario.rules
    with pytest.raises(ConfigError, match=r"scenario\.substeps = 0"):
        scenario.model_copy(update={"substeps": 0})
    with pytest.raises(ValueError, match=r"scenario\.substeps = 0"):
        Scenario.model_construct(substeps=0)


def test_frozen_and_hashable() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        Scenario().episode_steps = 3  # type: ignore[misc]
    assert hash(Scenario()) == hash(Scenario.preset("mixed"))
