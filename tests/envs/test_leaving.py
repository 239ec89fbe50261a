"""Robots that leave the arena and come back: who is there, who sees what, and what views say."""

from typing import Any

import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test
from pydantic import ValidationError
from worlds import batch, image, plan

from innerattn.config import Fault, Scenario
from innerattn.envs import BatchEnv, env, parallel_env
from innerattn.envs.render import draw_world, positions_of

STEPS = 12


def away(robot: str, **when: Any) -> Fault:
    return Fault(robot=robot, kind="unavailable", value=1.0, **when)


def leaving(*faults: Fault) -> Scenario:
    return Scenario(unavailable_robots="leave", faults=faults, episode_steps=STEPS)


LEAVES, JOINS = away("food_1", onset_step=5), away("medical_0", duration_steps=4)
"""From step 5 on, and in steps 0 to 3."""


def own_columns(world: BatchEnv, name: str) -> list[int]:
    return [i for i, one in enumerate(world.observation_names()) if one.startswith(name)]


def test_the_schedule_says_who_is_there() -> None:
    world = batch(2, leaving(LEAVES, JOINS))
    there = [world.present()]
    for actions in plan(STEPS - 1, 2):
        world.step(actions)
        there.append(world.present())
    food_1, medical_0 = (world.robot_names.index(name) for name in ("food_1", "medical_0"))
    for step, present in enumerate(there):
        wanted = np.ones((2, 4), np.bool_)
        wanted[:, food_1], wanted[:, medical_0] = step < 5, step >= 4
        assert (present == wanted).all(), step
        assert present.dtype == np.bool_


def test_nobody_sees_who_has_left_and_they_see_nothing() -> None:
    world = batch(3, leaving(away("food_1")))
    obs, number = world.observe(), world.robot_names.index("food_1")
    assert (obs[:, number] == 0.0).all()
    assert (obs[:, :number] != 0.0).any()
    block = own_columns(world, f"teammate_{number - 1}.")  # of robots before it, it is that one
    assert block
    assert (obs[:, 0][:, block] == 0.0).all()
    stays = batch(3, leaving(away("food_1")).replace(unavailable_robots="stay"))
    assert (stays.observe()[:, 0][:, block] != 0.0).any()


def test_unavailable_robots_that_stay_are_present() -> None:
    assert batch(2, Scenario(faults=(away("food_1"),))).present().all()


def test_robots_leave_and_come_back_as_they_are_told() -> None:
    world, twin = batch(4, leaving()), batch(4, leaving())
    wanted = np.ones((4, 4), np.bool_)
    wanted[1, 2] = wanted[2, 0] = False
    chosen = np.array([True, True, False, True])
    for one in (world, twin):
        one.set_present(wanted, chosen)
        assert one.present().tolist() == [[True] * 4, [True, True, False, True], *[[True] * 4] * 2]
    for actions in plan(5, 4):
        world.step(actions)
        twin.step(actions)
    left = world.positions()[1, 2].copy()
    assert (world.velocities()[1, 2] == 0.0).all()
    for one in (world, twin):
        one.set_present(np.ones((4, 4), np.bool_))
        assert one.present().all()
    assert (world.positions()[1, 2] != left).any(), "a new place is drawn"
    assert (world.positions() == twin.positions()).all(), "the seed decides it"
    gaps = np.linalg.norm(world.positions()[1] - world.positions()[1, 2], axis=-1)
    radii = np.array([robot.radius_m for robot in world.scenario.robots])
    assert (np.delete(gaps - radii - radii[2], 2) > 0.0).all(), "clear of the others"


def test_other_faults_stay_and_a_reset_brings_all_back() -> None:
    world = batch(2, leaving(Fault(robot="food_0", kind="motor_gain", value=0.5)))
    present = np.zeros((2, 4), np.bool_)
    world.set_present(present)
    assert not world.present().any()
    assert world.fault_state()["motor_gain"][:, 0].tolist() == [0.5, 0.5]
    for actions in plan(3, 2):
        step = world.step(actions)
        assert (step.obs == 0.0).all()
        assert not len(step.rescues)
    world.reset()
    assert world.present().all()


@pytest.mark.parametrize(
    ("present", "error", "message"),
    [
        (np.ones((2, 4)), TypeError, "present has dtype float64: must be bool"),
        (np.ones((4,), np.bool_), ValueError, r"present has shape \(4,\): must be \(2, 4\)"),
    ],
)
def test_wrong_presence_changes_nothing(
    present: np.ndarray, error: type[Exception], message: str
) -> None:
    world = batch(2, leaving(LEAVES))
    before = world.snapshot()
    with pytest.raises(error, match=message):
        world.set_present(present)
    with pytest.raises((TypeError, ValueError), match="mask"):
        world.set_present(np.ones((2, 4), np.bool_), np.ones(3, np.bool_))
    assert world.snapshot() == before


def test_robots_that_stay_cannot_be_sent_away() -> None:
    world = batch(2, Scenario())
    before = world.snapshot()
    with pytest.raises(ValueError, match="unavailable_robots = 'stay': must be 'leave'"):
        world.set_present(np.zeros((2, 4), np.bool_))
    assert world.snapshot() == before


def test_robots_are_there_or_not() -> None:
    with pytest.raises(ValidationError, match=r"value \(unavailable\) = 0.5: must be 0 or 1"):
        BatchEnv(leaving(Fault(robot="food_0", kind="unavailable", value=0.5)), 1)


def test_worlds_are_the_same_in_any_batch() -> None:
    one, many = batch(1, leaving(LEAVES, JOINS)), batch(6, leaving(LEAVES, JOINS), num_threads=2)
    for actions in plan(2 * STEPS, 6):
        single, several = one.step(actions[:1]), many.step(actions)
        assert image(single, one, slice(0, 1)) == image(several, many, slice(0, 1))


def test_agents_shrink_and_grow() -> None:
    world = parallel_env(leaving(LEAVES, JOINS))
    seen, infos = world.reset(seed=1)
    early = ["food_0", "food_1", "navigation_0"]
    late = ["food_0", "navigation_0", "medical_0"]
    assert set(world.agents) == set(early) == set(seen) == set(infos)
    for step in range(1, STEPS + 1):
        before = list(world.agents)
        given = world.step(dict.fromkeys(before, 1))
        wanted = [
            one
            for one in world.possible_agents
            if (one != "food_1" or step < 5) and (one != "medical_0" or step >= 4)
        ]
        assert world.agents == ([] if step == STEPS else wanted)
        known = set(before) | set(wanted)
        assert all(set(one) == known for one in given)
        obs, _, terminated, truncated, _ = given
        assert not any(terminated.values())
        if step < STEPS:
            assert {one for one in known if truncated[one]} == known - set(wanted)
        else:
            assert all(truncated.values())
            assert known == set(late)
        assert all((obs[one] != 0.0).any() for one in wanted)


def test_who_is_not_there_takes_no_action() -> None:
    world = parallel_env(leaving(JOINS))
    world.reset(seed=1)
    with pytest.raises(ValueError, match="medical_0"):
        world.step(dict.fromkeys(world.possible_agents, 1))


def test_an_episode_goes_on_while_all_are_away() -> None:
    faults = [away(robot.name, onset_step=2, duration_steps=3) for robot in Scenario().robots]
    world = parallel_env(leaving(*faults))
    world.reset(seed=3)
    sizes = []
    for _ in range(STEPS):
        world.step(dict.fromkeys(world.agents, 2))
        sizes.append(len(world.agents))
    assert sizes == [4, 0, 0, 0, *[4] * 7, 0]


# The last observation of a robot that has left is zeros.
@pytest.mark.filterwarnings("ignore:Observation numpy array is all zeros:UserWarning")
@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_pettingzoo_takes_robots_that_leave(actions: str) -> None:
    parallel_api_test(parallel_env(leaving(LEAVES), actions=actions), num_cycles=60)
    api_test(env(leaving(LEAVES), actions=actions), num_cycles=60)


# PettingZoo's check knows no agents that join; its base classes and documentation do.
@pytest.mark.filterwarnings("ignore:Agent was given .* but was dead last turn:UserWarning")
def test_pettingzoo_takes_robots_that_join() -> None:
    parallel_api_test(parallel_env(leaving(LEAVES, JOINS)), num_cycles=60)


def test_turns_are_of_those_who_are_there() -> None:
    turns = env(leaving(LEAVES, JOINS))
    turns.reset(seed=1)
    acted: dict[str, int] = dict.fromkeys(turns.possible_agents, 0)
    for agent in turns.agent_iter():
        *_, terminated, truncated, _ = turns.last()
        over = terminated or truncated
        acted[agent] += not over
        turns.step(None if over else 1)
    assert acted == {"food_0": STEPS, "food_1": 5, "navigation_0": STEPS, "medical_0": STEPS - 4}


def test_pictures_leave_out_who_has_left() -> None:
    world = batch(1, leaving(away("food_1")))

    def picture(positions: np.ndarray) -> np.ndarray:
        still, nobody = np.zeros((4, 2), np.float32), world.victims()[0][:0]
        return draw_world(world.scenario, positions, still, nobody, world.obstacles()[0])

    positions = np.array([(-0.5, -0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, 0.5)], np.float32)
    seen = positions_of(positions, world.present()[0])
    assert np.isnan(seen).all(-1).tolist() == [not one for one in world.present()[0]]
    different = (picture(positions) != picture(seen)).any(-1)
    rows, columns = np.nonzero(different)
    assert rows.size, "the robot is drawn while it is there"
    assert np.ptp(rows) < 100
    assert np.ptp(columns) < 100
