"""Tables read from observations, against the true state of the worlds."""

from contextlib import closing

import numpy as np
import pytest
import torch

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.config.scenario import Fault
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.nn.teams import TeamActor, TeamTables, relate
from innerattn.train.teams.sheet import TeamSheet, as_tensor

NOISE = Fault(robot="robot_0", kind="position_noise", value=0.0)


@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("each", [False, True])
def test_tables_are_the_true_state(number: int, each: bool) -> None:
    family = Family(unavailable=0.5, service=0.6, deadline=0.5, order=0.6, tasks=(2, 3))
    scenario = family.draw(8, number)
    if each:  # senses may fail, though they do not
        scenario = scenario.replace(faults=(*scenario.faults, NOISE))
    with closing(BatchEnv(scenario, 7, seed=number)) as env:
        env.reset()
        rng = np.random.default_rng(number)
        for _ in range(5):
            obs = env.step(rng.integers(0, 5, (7, env.num_robots))).obs
        sheet = TeamSheet(scenario, env.observation_names())
        assert sheet.each_sees == each
        tables = sheet.tables(as_tensor(obs))
        copies = env.num_robots if each else 1
        positions, velocities = env.positions(), env.velocities()
        for found, true in ((tables.positions, positions), (tables.velocities, velocities)):
            np.testing.assert_allclose(found, np.repeat(true, copies, 0), atol=1e-5)
        abilities = sorted({one for robot in scenario.robots for one in robot.abilities})
        able = np.array([[a in robot.abilities for a in abilities] for robot in scenario.robots])
        available = env.fault_state()["unavailable"] < 0.5
        expected = np.repeat(able & available[..., None], copies, 0)
        np.testing.assert_array_equal(tables.abilities, expected)
        _same_victims(tables, env, abilities, copies)


def _same_victims(tables: TeamTables, env: BatchEnv, abilities: list[str], copies: int) -> None:
    """Victims are those that are present, in any order, and wait for as long as they do."""
    scenario = env.scenario
    needs = [[task.needs.count(one) for one in abilities] for task in scenario.tasks]
    services = [
        max(one.service_s for one, its in zip(scenario.tasks, needs, strict=True) if its == own)
        for own in needs
    ]
    counts = np.repeat(env.step_counts(), copies)

    def waits(victim: np.void, steps: int) -> tuple[float, float, float]:
        fields = victim.dtype.names or ()
        left = 1e3
        if "deadline_step" in fields and victim["deadline_step"] >= 0:
            left = (victim["deadline_step"] - steps) * scenario.dt_s
        served = victim["served"] if "served" in fields else 1.0
        blocked = victim["blocked"] if "blocked" in fields else False
        return (1.0 - served) * services[victim["task"]], left, float(blocked)

    for row, victims in enumerate(np.repeat(env.victims(), copies, 0)):
        true = sorted(
            (*(float(v[axis]) for axis in "xy"), *needs[v["task"]], *waits(v, counts[row]))
            for v in victims
            if v["present"]
        )
        columns = torch.cat([tables.places[row], tables.needs[row], tables.waits[row]], -1)
        found = sorted(columns[tables.is_victim[row]].tolist())
        # The longest deadline, which times are shares of, ends with a step.
        close = np.array([*[1e-5] * (2 + len(abilities)), 1e-5, scenario.dt_s, 0.0])
        assert len(found) == len(true)
        assert not found or np.all(np.abs(np.subtract(found, true)) <= close)


def test_who_sees_for_himself_acts_as_all_do_while_senses_are_well() -> None:
    scenario = Family(unavailable=0.0).draw(2, 1)
    torch.manual_seed(0)
    actor = TeamActor(16, "inner", 8)
    with closing(BatchEnv(scenario, 9, seed=3)) as env:
        obs, names = as_tensor(env.reset()), env.observation_names()
    together = TeamSheet(scenario, names)
    each = TeamSheet(scenario.replace(faults=[NOISE.model_dump()]), names)
    found = [sheet.own_rows(actor(relate(sheet.tables(obs)))) for sheet in (together, each)]
    torch.testing.assert_close(found[0], found[1], atol=1e-4, rtol=1e-4)


def test_continuous_actions_are_refused() -> None:
    scenario = Scenario(actions="continuous")
    with pytest.raises(ConfigError, match="actions = 'continuous': must be 'discrete'"):
        TeamSheet(scenario, BatchEnv(scenario, 1).observation_names())


@pytest.mark.parametrize("key", ["observed_teammates", "observed_victims"])
def test_rows_without_all_robots_and_victims_are_refused(key: str) -> None:
    scenario = Scenario().replace(**{key: 1})
    with pytest.raises(ConfigError, match=f"scenario.{key} = 1: must be left out; policies for"):
        TeamSheet(scenario, BatchEnv(scenario, 1).observation_names())


@pytest.mark.parametrize("each", [False, True])
def test_a_robot_that_never_comes_changes_nothing(each: bool) -> None:
    alone = Scenario.preset("mixed").replace(engine="discs", unavailable_robots="leave")
    if each:
        sees = Fault(robot="food_0", kind="position_noise", value=0.0)
        alone = alone.replace(faults=(sees,))
    robots = [robot.model_dump() for robot in alone.robots]
    away = Fault(robot="food_2", kind="unavailable", value=1.0)
    beside = alone.replace(
        robots=[*robots, robots[0] | {"name": "food_2"}], faults=(*alone.faults, away)
    )
    torch.manual_seed(1)
    actor = TeamActor(8, "inner", 4)
    chosen, rng = [], np.random.default_rng(0)
    plan = rng.integers(0, 5, (12, 9, 5))
    for scenario in (alone, beside):
        with closing(BatchEnv(scenario, 9, seed=3)) as env:
            sheet, obs, found = TeamSheet(scenario, env.observation_names()), env.reset(), []
            for actions in plan:
                with torch.no_grad():
                    rows = sheet.own_rows(actor(relate(sheet.tables(as_tensor(obs)))))
                found.append(rows.view(9, env.num_robots, -1)[:, :4])
                obs = env.step(actions[:, : env.num_robots]).obs
            chosen.append(torch.stack(found))
    torch.testing.assert_close(chosen[0], chosen[1])


def test_victims_are_known_when_the_first_robot_has_left() -> None:
    scenario = Scenario.preset("mixed").replace(unavailable_robots="leave")
    with closing(BatchEnv(scenario, 4, seed=1)) as env:
        present = np.ones((4, 4), np.bool_)
        present[:2, 0] = False
        present[0, 1] = False
        env.set_present(present)
        tables = TeamSheet(scenario, env.observation_names()).tables(as_tensor(env.observe()))
        np.testing.assert_array_equal(tables.is_there, present)
        assert not tables.abilities[0, :2].any()
        abilities = sorted({one for robot in scenario.robots for one in robot.abilities})
        _same_victims(tables, env, abilities, 1)


def test_who_is_not_heard_is_not_there() -> None:
    scenario = Scenario.preset("mixed")
    with closing(BatchEnv(scenario, 3, seed=1)) as env:
        obs, names = as_tensor(env.reset()), env.observation_names()
    heard = TeamSheet(scenario, names, each_sees=True).tables(obs)
    assert heard.is_there.all()
    silent = obs.clone()
    silent[:, 0, [name.startswith("teammate_1.") for name in names]] = 0.0
    tables = TeamSheet(scenario, names, each_sees=True).tables(silent)
    expected = np.ones((12, 4), np.bool_)
    expected[::4, 2] = False  # the first robot does not hear the third
    np.testing.assert_array_equal(tables.is_there, expected)
    assert not tables.abilities[::4, 2].any()
    torch.testing.assert_close(tables.positions[1:4], heard.positions[1:4])
