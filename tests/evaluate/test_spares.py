"""Spare robots: outside they change nothing, and they come in, act and leave as they are told."""

from contextlib import closing

import numpy as np
import pytest
from numpy.typing import NDArray
from spare_robots import spared_world
from team_of_any import TEAM

from innerattn.config import Fault, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.evaluate.interactive import HEALTHY, InteractiveWorld
from innerattn.evaluate.spares import with_spares, with_usual_spares
from innerattn.policies import PolicyInput, WorldState, scripted_policy
from innerattn.policies.scripted.crew import CrewPolicy

DISCS = TEAM.replace(engine="discs")
AWAY = Fault(robot="medic", kind="unavailable", value=1.0, onset_step=5)


def moved(world: InteractiveWorld, robot: int, **values: float) -> None:
    world.set_faults(robot, values)


def present(world: InteractiveWorld) -> list[str]:
    robots, faults = world.scenario.robots, world.moment().faults["unavailable"]
    return [one.name for one, away in zip(robots, faults, strict=True) if away < 1.0]


def test_they_are_copies_behind_the_own_robots() -> None:
    robots = [
        one.model_copy(update={"start_m": (0.35 * at - 0.8, 0.5)})
        for at, one in enumerate(TEAM.robots)
    ]
    team = TEAM.replace(robots=robots)
    worlds = with_spares(team, 2)
    assert worlds.robots[:5] == team.robots
    assert [one.name for one in worlds.robots[5:]] == [
        *("drone_2", "drone_3", "digger_2", "digger_3", "medic_0", "medic_1")
    ]
    for spare in worlds.robots[5:]:
        first = next(one for one in team.robots if one.kind == spare.kind)
        assert spare == first.model_copy(update={"name": spare.name, "start_m": None})
    assert worlds.robots_leave
    assert with_spares(team, 0) is team
    with closing(BatchEnv(worlds, 3)) as env:
        for _ in range(3):
            env.reset()
            assert env.present().tolist() == [[True] * 5 + [False] * 6] * 3


def test_where_there_is_no_room_there_are_fewer() -> None:
    assert with_usual_spares(TEAM).num_robots == 11
    robot = TEAM.robots[0]
    many = TEAM.replace(
        robots=[*TEAM.robots, *(robot.model_copy(update={"name": f"d{at}"}) for at in range(55))],
        arena_half_width_m=4.0,
    )
    assert with_usual_spares(many).num_robots == 63
    with pytest.raises(ConfigError, match=r"scenario\.robots \(their number\) = 66: must be in"):
        with_spares(many, 2)
    small = TEAM.replace(
        robots=[one.model_copy(update={"radius_m": 0.18}) for one in TEAM.robots],
        arena_half_width_m=0.65,
        rescue_radius_m=0.3,
        spawn_clearance_m=0.0,
    )
    assert with_usual_spares(small) is small
    with pytest.raises(ConfigError, match=r"scenario\.robots"):
        with_spares(small, 2)


def test_robots_that_stay_when_unavailable_go_on_staying() -> None:
    stays = TEAM.replace(faults=[AWAY])
    assert with_usual_spares(stays) is stays
    with pytest.raises(ConfigError, match="unavailable_robots = 'stay': must be 'leave'"):
        with_spares(stays, 1)
    leaves = with_usual_spares(stays.replace(unavailable_robots="leave"))
    assert leaves.faults[0] == AWAY
    assert leaves.num_robots == 11


@pytest.mark.parametrize("name", ["random", "greedy", "hungarian", "planner", "oracle"])
def test_outside_they_change_nothing(name: str) -> None:
    """Where contacts are exact, no bit of what own robots do."""
    with_them, without = spared_world(DISCS, 2, name), spared_world(DISCS, 0, name)
    for step in range(120):
        one, other = with_them.moment(), without.moment()
        assert np.array_equal(one.positions[:5], other.positions), step
        assert np.array_equal(one.velocities[:5], other.velocities), step
        assert np.array_equal(one.victims, other.victims), step
        assert (one.rescued, one.rescues) == (other.rescued, other.rescues), step
        with_them.step()
        without.step()
    assert name == "random" or one.rescued > 5


def test_outside_they_change_nothing_for_a_policy_for_any_team() -> None:
    with_them, without = (spared_world(DISCS, each, "zoo:any") for each in (2, 0))
    for step in range(60):
        one, other = with_them.moment(), without.moment()
        assert np.array_equal(one.positions[:5], other.positions), step
        assert np.array_equal(one.victims, other.victims), step
        with_them.step()
        without.step()
    assert one.rescued == other.rescued > 2


def shared_columns(names: list[str], known: list[str]) -> NDArray[np.intp]:
    return np.array([names.index(one) for one in known])


def test_what_own_robots_see_is_the_same_with_rigid_bodies_too() -> None:
    """From one state a step gives the same but for contacts, which are solved in another order."""
    rng = np.random.default_rng(5)
    with (
        closing(BatchEnv(with_spares(TEAM, 2), 8, 3)) as one,
        closing(BatchEnv(TEAM, 8, 3)) as other,
    ):
        columns = shared_columns(one.observation_names(), other.observation_names())
        spare = np.delete(np.arange(len(one.observation_names())), columns)
        obs, wanted = one.reset(), other.reset()
        apart = []
        for _ in range(200):
            assert np.array_equal(obs[:, :5][:, :, columns], wanted)
            assert not obs[:, :5][:, :, spare].any()
            assert not obs[:, 5:].any()
            actions = rng.integers(0, 5, (8, 5))
            other.step(actions)
            one.step(np.concatenate([actions, rng.integers(0, 5, (8, 6))], axis=1))
            places, expected = one.positions(), other.positions()
            apart.append(np.abs(places[:, :5] - expected).max(axis=(1, 2)))
            velocities = one.velocities()
            places[:, :5], velocities[:, :5] = expected, other.velocities()
            one.set_motion(places, velocities)
            obs, wanted = one.observe(), other.observe()
    metres = np.array(apart)
    assert (metres == 0.0).mean() > 0.5, "nobody touched anything"
    assert 0.95 < (metres < 1e-5).mean() < 1.0
    assert metres.max() < 0.01


def test_a_robot_comes_in_and_leaves() -> None:
    world = spared_world(TEAM, 2, "hungarian")
    own = [one.name for one in TEAM.robots]
    assert present(world) == own
    moved(world, 7, blackout=1.0)
    world.add_robot("digger")
    moment = world.moment()
    assert present(world) == [*own, "digger_2"]
    assert all(moment.faults[kind][7] == healthy for kind, healthy in HEALTHY.items())
    gaps = np.linalg.norm(moment.positions[:5] - moment.positions[7], axis=-1)
    assert (gaps > 0.1).all(), "clear of the others"
    before = moment.positions[7]
    for _ in range(20):
        world.step()
    assert np.linalg.norm(world.moment().positions[7] - before) > 0.1, "it acts"
    world.add_robot("digger")
    assert present(world)[-2:] == ["digger_2", "digger_3"]
    moved(world, 7, unavailable=1.0)
    assert present(world) == [*own, "digger_3"]
    world.add_robot("digger")
    assert present(world) == [*own, "digger_2", "digger_3"]
    world.restart()
    assert present(world) == own


def test_what_cannot_be_added_is_refused() -> None:
    world = spared_world(TEAM, 1, "greedy")
    world.add_robot("medic")
    before = world.moment()
    for kind, said in (
        ("medic", "all 1 spare medic robots are in the arena: take one out first"),
        ("food", "kind = 'food': must be one of drone, digger, medic"),
    ):
        with pytest.raises(ValueError, match=said):
            world.add_robot(kind)
        assert np.array_equal(world.moment().positions, before.positions)
        assert np.array_equal(world.moment().faults, before.faults)
    with pytest.raises(ValueError, match="kind = 'medic': no robot can be added to this world"):
        spared_world(TEAM, 0, "greedy").add_robot("medic")


@pytest.mark.parametrize(
    ("out", "joins", "crew"),
    [
        ((), (), range(5)),
        ((2,), (7, 8), (0, 1, 3, 4, 7, 8)),
        ((0, 1), (5,), (2, 3, 4, 5)),
        ((4,), (6,), (0, 1, 2, 3, 4, 6)),  # nobody else is a medic
        ((4,), (9,), (0, 1, 2, 3, 9)),
    ],
)
@pytest.mark.parametrize("name", ["greedy", "hungarian", "planner"])
def test_scripts_plan_with_those_that_are_there(
    name: str, out: tuple[int, ...], joins: tuple[int, ...], crew: tuple[int, ...]
) -> None:
    """They act as in a world of these alone."""
    worlds, crew = with_spares(TEAM, 2), tuple(crew)
    few = TEAM.replace(robots=[worlds.robots[at] for at in crew])
    policy = CrewPolicy(lambda one: scripted_policy(name, one), worlds, 5)
    alone = scripted_policy(name, few)
    there = np.isin(np.arange(11), [*set(range(5)) - set(out), *joins])[None]
    with closing(BatchEnv(worlds, 1, 8)) as one, closing(BatchEnv(few, 1, 8)) as other:
        one.set_present(there)
        for _ in range(30):
            other.set_motion(one.positions()[:, crew], one.velocities()[:, crew])
            state = WorldState.of(one)
            wanted = WorldState.of(other)._replace(victims=state.victims)
            chosen = policy.act(PolicyInput(one.observe(), state))
            expected = alone.act(PolicyInput(other.observe(), wanted))
            assert np.array_equal(chosen[:, crew], expected)
            assert not np.delete(chosen, crew, axis=1).any()
            one.step(chosen)


def test_random_robots_draw_what_they_draw_alone() -> None:
    worlds = with_spares(TEAM, 2)
    policy = CrewPolicy(lambda one: scripted_policy("random", one), worlds, 5)
    alone = scripted_policy("random", TEAM)
    policy.reset(4)
    alone.reset(4)
    with closing(BatchEnv(worlds, 1)) as env:
        obs, state = env.reset(), WorldState.of(env)
        for _ in range(5):
            chosen = policy.act(PolicyInput(obs, state))
            assert np.array_equal(chosen[:, :5], alone.act(PolicyInput(obs[:, :5])))


def test_a_preset_gets_spares_of_each_kind() -> None:
    names = [one.name for one in with_usual_spares(Scenario.preset("mixed")).robots[4:]]
    kinds = ("food_2", "food_3", "navigation_1", "navigation_2", "medical_1", "medical_2")
    assert names == list(kinds)
