"""Whose the columns of an observation are."""

from contextlib import closing

import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.nn import EntityColumns
from innerattn.train.columns import entity_columns

OWN = ["own.position.x", "own.available"]
TEAMMATES = ["teammate_0.x", "teammate_0.y", "teammate_1.x", "teammate_1.y"]
VICTIMS = ["victim_0.need", "victim_0.present", "victim_1.need", "victim_1.present"]


def test_columns_are_counted() -> None:
    assert entity_columns(OWN + TEAMMATES + VICTIMS) == EntityColumns(2, 2, 2, 2, 2, 1)
    assert entity_columns(OWN + VICTIMS) == EntityColumns(2, 0, 0, 2, 2, 1)


@pytest.mark.parametrize("situation", ["single", "double", "mixed"])
@pytest.mark.parametrize("robots", [1, 2, 4])
def test_worlds_have_such_columns(situation: str, robots: int) -> None:
    scenario = Scenario.preset(situation)
    tasks = [task.replace(needs=["food"]) for task in scenario.tasks]
    scenario = scenario.replace(robots=scenario.robots[:robots], tasks=tasks)
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        found = entity_columns(env.observation_names())
        assert found.width == env.obs_width
    assert found.teammates == robots - 1
    assert found.victims == (1 if situation == "single" else 2)
    assert found.present == 0


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        (["time", *OWN, *VICTIMS], "column 0 of an observation is 'time', not 'own.position.x'"),
        (VICTIMS, "no column own"),
        (OWN, "no column victim_0.present"),
        (OWN + VICTIMS[::2], "no column victim_0.present"),
        (OWN + VICTIMS[:3], "column 5 of an observation is None, not 'victim_1.present'"),
        (OWN + VICTIMS + TEAMMATES, "column 2 .* is 'victim_0.need', not 'teammate_0.x'"),
        (OWN + TEAMMATES[:3] + VICTIMS, "column 5 .* is 'victim_0.need', not 'teammate_1.y'"),
        (OWN + TEAMMATES[2:] + VICTIMS, "column 2 .* is 'teammate_1.x', not 'victim_0.need'"),
        (TEAMMATES + OWN + VICTIMS, "column 0 .* is 'teammate_0.x', not 'own.position.x'"),
    ],
)
def test_other_columns_are_refused(names: list[str], reason: str) -> None:
    with pytest.raises(ConfigError, match=rf"^network\.encoder = 'entities': .*{reason}.*'flat'"):
        entity_columns(names)
