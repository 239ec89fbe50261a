"""Abilities and needs with amounts in a configuration: read, kept, and refused where wrong."""

import copy
import json
import pickle
from typing import Any

import pytest

from innerattn.config import Scenario
from innerattn.config.load import load_run_config, read_toml, write_toml
from innerattn.errors import ConfigError


def robots(*abilities: object) -> list[dict[str, Any]]:
    body = {"kind": "boat", "max_speed_mps": 1.0, "mass_kg": 1.0}
    return [{"name": f"boat_{i}", "abilities": one, **body} for i, one in enumerate(abilities)]


TEAM = robots({"water": 1.2}, {"water": 0.7, "rope": 2}, ["water"])


def scenario(needs: object, team: object = TEAM) -> Scenario:
    return Scenario().replace(robots=team, tasks=[{"name": "fire", "needs": needs}])


def test_a_list_and_a_table_are_kept_as_they_were_given() -> None:
    made = scenario({"water": 2.9})
    assert [robot.abilities for robot in made.robots] == [
        {"water": 1.2},
        {"water": 0.7, "rope": 2.0},
        ("water",),
    ]
    assert [robot.amount("water") for robot in made.robots] == [1.2, 0.7, 1.0]
    (task,) = made.tasks
    assert (task.needs, task.sums, task.roles) == ({"water": 2.9}, {"water": 2.9}, ())
    listed = scenario(["water", "rope", "water"]).tasks[0]
    assert (listed.sums, listed.roles) == ({}, ("water", "rope", "water"))
    assert [listed.amount(one) for one in ("water", "rope", "food")] == [2.0, 1.0, 0.0]
    assert (made.max_helpers, scenario({"rope": 1.0}).max_helpers) == (3, 1)
    assert Scenario.model_validate(json.loads(made.model_dump_json())) == made


def test_a_scenario_with_amounts_is_a_value_like_any_other() -> None:
    made = scenario({"water": 2.9})
    for other in (pickle.loads(pickle.dumps(made)), copy.deepcopy(made)):
        assert (other, hash(other)) == (made, hash(made))
    needs: Any = made.tasks[0].needs
    for change in (lambda: needs.update(water=1.0), lambda: needs.__setitem__("water", 1.0)):
        with pytest.raises(TypeError, match="cannot be changed"):
            change()


def test_a_file_of_a_run_keeps_them(tmp_path: Any) -> None:
    config = load_run_config().replace(scenario=scenario({"water": 2.9}))
    write_toml(config, tmp_path / "config.toml")
    assert read_toml(tmp_path / "config.toml") == config


_FORM = "must be a list of names, or a table of names with finite numbers"


@pytest.mark.parametrize(
    ("needs", "message"),
    [
        (3, f"tasks[0].needs = 3: {_FORM}"),
        ([3], f"tasks[0].needs = [3]: {_FORM}"),
        ({"water": "3"}, f"tasks[0].needs = {{'water': '3'}}: {_FORM}"),
        ({"water": True}, f"tasks[0].needs = {{'water': True}}: {_FORM}"),
        ({"water": float("inf")}, f"tasks[0].needs = {{'water': inf}}: {_FORM}"),
        ({"water": float("nan")}, f"tasks[0].needs = {{'water': nan}}: {_FORM}"),
        ({"water": 0}, "tasks[0].needs.water = 0: must be in 0.000001..=1000000"),
        ({"water": -1.5}, "tasks[0].needs.water = -1.5: must be in 0.000001..=1000000"),
        ({}, "tasks[0].needs (their number) = 0: must be in 1..=8"),
        (
            {"rope": 1.0, "water": 3.0},
            'tasks[0].needs.water = 3: task "fire" needs more than the whole team has, which is '
            "2.9",
        ),
        (
            {"watr": 1.0},
            "tasks[0].needs: task 'fire' needs 'watr', which no robot of the team can do; "
            "abilities of the team are water, rope, did you mean 'water'?",
        ),
    ],
)
def test_wrong_needs_are_refused_in_one_line(needs: object, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        scenario(needs)
    assert str(error.value) == f"scenario.{message}"


def test_wrong_abilities_are_refused_in_one_line() -> None:
    for amount, message in ((0.0, "must be in 0.000001..=1000000"), ("1", _FORM)):
        with pytest.raises(ConfigError, match=r"^scenario\.robots\[1\]\.abilities") as error:
            scenario(["water"], robots(["water"], {"water": amount}))
        assert str(error.value).endswith(message)
