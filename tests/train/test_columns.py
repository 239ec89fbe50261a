"""Whose the columns of an observation are."""

from contextlib import closing

import pytest
import torch

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.nn import NUM_ELEMENTS, EntityColumns, SquareSymmetry
from innerattn.train.columns import entity_columns, state_columns

OWN = ["own.position.x", "own.available"]
TEAMMATES = ["teammate_0.x", "teammate_0.y", "teammate_1.x", "teammate_1.y"]
VICTIMS = ["victim_0.need", "victim_0.present", "victim_1.need", "victim_1.present"]


def test_columns_are_counted() -> None:
    assert entity_columns(OWN + TEAMMATES + VICTIMS) == EntityColumns(2, 2, 2, 2, 2, 1)
    assert entity_columns(OWN + VICTIMS) == EntityColumns(2, 0, 0, 2, 2, 1)


def test_columns_say_who_is_seen_and_where_limited_sight_needs_it() -> None:
    for preset, limited in (("mixed", False), ("mixed-sight", True), ("mixed-radio", True)):
        with closing(BatchEnv(preset, 1, num_threads=1)) as env:
            names = env.observation_names()
        found = entity_columns(names)
        teammate = [name for name in names if name.startswith("teammate_0.")]
        victim = [name for name in names if name.startswith("victim_0.")]
        assert (found.seen is not None) == limited
        if found.seen is not None:
            assert teammate[found.seen] == "teammate_0.seen"
        for place, block in ((found.teammate_place, teammate), (found.victim_place, victim)):
            assert place is not None
            assert [block[one].partition(".")[2] for one in place] == [
                "relative_position.x",
                "relative_position.y",
            ]


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


@pytest.mark.parametrize("situation", ["single", "double", "mixed"])
def test_the_state_of_a_turned_world_has_the_same_form(situation: str) -> None:
    with closing(BatchEnv(situation, 50, seed=4, num_threads=1)) as env:
        env.reset()
        names, states = env.state_names(), torch.from_numpy(env.state())
    states[:10, names.index("victim_0.position.x") :] = 0.0  # no victim: a robot's place decides
    symmetry = SquareSymmetry(state_columns(names), torch.device("cpu"))
    form = symmetry.turn(states, symmetry.frame(states))
    for element in range(NUM_ELEMENTS):
        turned = symmetry.turn(states, torch.full((50,), element))
        by_hand = states.clone()
        for axis, other, bit in (("x", "y", 1), ("y", "x", 2)):
            for name in names:
                if name.endswith(f".{axis}"):
                    partner = name[:-1] + (other if element >= 4 else axis)
                    sign = -1.0 if element & bit else 1.0
                    by_hand[:, names.index(partner)] = sign * states[:, names.index(name)]
        assert torch.equal(turned, by_hand)
        assert torch.equal(symmetry.turn(turned, symmetry.frame(turned)), form)
