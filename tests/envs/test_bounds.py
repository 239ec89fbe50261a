"""Bounds of observations and states: finite, kept by any play, and no wider than they need be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from innerattn import _core
from innerattn.config import Fault, Obstacle, Robot, Scenario, Task
from innerattn.envs import BatchEnv
from innerattn.envs.bounds import observation_bounds, state_bounds

KINDS = [name for name, *_ in _core.FAULT_KINDS]
MOST = {name: most for name, _, _, most, _, _ in _core.FAULT_KINDS}


def scenario(half: float, engine: str, faulty: bool, seen: bool, heavy: float) -> Scenario:
    """Four robots in a small arena, one of them heavy, and with every fault at its worst."""
    team = list(Scenario().robots)
    heavy = heavy if engine == "discs" else min(heavy, 8.0)  # rapier takes masses up to 16 : 1
    team[0] = team[0].replace(mass_kg=heavy, drive_force_n=200.0)
    if seen:
        team[1] = team[1].replace(abilities={"food": 6.0})
    faults = [
        Fault(robot=robot.name, kind=kind, value=MOST[kind] if kind != "motor_gain" else 0.5)
        for robot, kind in zip((*team, *team, *team), KINDS, strict=False)
    ]
    return Scenario(
        robots=tuple(team),
        arena_half_width_m=half,
        spawn_clearance_m=0.0,
        wall_clearance_m=0.05,
        engine=engine,
        faults=tuple(faults) if faulty else (),
        observe_faults=seen,
        tasks=(
            Task(
                name="both",
                needs={"food": 7.0, "medicine": 0.5} if seen else ("food", "food"),
                service_s=0.3 if seen else 0.0,
            ),
            Task(
                name="one",
                needs=("medicine",),
                deadline_s=(0.5, 2.0) if seen else None,
                after=("both",) if seen else (),
            ),
        ),
        obstacles=(Obstacle(shape="disc", radius_m=0.05),),
    )


@settings(max_examples=25)
@given(
    half=st.floats(0.4, 3.0),
    engine=st.sampled_from(["rapier", "discs"]),
    faulty=st.booleans(),
    seen=st.booleans(),
    heavy=st.floats(0.5, 40.0),
    seed=st.integers(0, 2**32),
)
def test_no_play_leaves_the_bounds(
    half: float, engine: str, faulty: bool, seen: bool, heavy: float, seed: int
) -> None:
    env = BatchEnv(scenario(half, engine, faulty, seen, heavy), 16, seed, num_threads=1)
    low, high = observation_bounds(env.scenario)
    least, most = state_bounds(env.scenario)
    assert low.shape == high.shape == (env.obs_width,)
    assert np.isfinite([low, high]).all()
    assert np.isfinite([least, most]).all()
    assert (low < high).all()
    assert (least < most).all()
    chance = np.random.default_rng(seed)
    obs = env.reset()
    actions = chance.integers(5, size=(16, 4))
    for _ in range(60):
        state = env.state()
        assert ((low <= obs) & (obs <= high)).all()
        assert ((least <= state) & (state <= most)).all()
        new = chance.random((16, 4)) < 0.2  # held for some steps, so that speeds grow
        actions[new] = chance.integers(5, size=new.sum())
        step = env.step(actions)
        assert ((low <= step.final_obs) & (step.final_obs <= high)).all()
        obs = step.obs


def test_the_bounds_of_the_papers_team() -> None:
    env = BatchEnv("mixed", 1)
    low, high = observation_bounds(env.scenario)
    found = dict(zip(env.observation_names(), zip(low, high, strict=True), strict=True))
    energy = 1.0 + 1.0 + 0.5 * 1.5**2 * 2
    fastest = (energy / 0.5) ** 0.5  # a light robot with all of it
    assert found["own.position.x"] == pytest.approx((-1, 1), rel=1e-4)
    assert found["own.velocity.y"] == pytest.approx((-fastest, fastest), rel=1e-3)
    assert found["teammate_0.relative_position.x"] == pytest.approx((-2, 2), rel=1e-4)
    assert found["teammate_2.relative_velocity.x"][1] == pytest.approx(2 * fastest, rel=1e-3)
    assert found["own.ability.food"] == found["own.available"] == (0, 1)
    assert found["victim_1.need.food"] == found["victim_0.present"] == (0, 1)
    assert found["victim_0.relative_position.y"] == pytest.approx((-2, 2), rel=1e-4)
    names = env.state_names()
    assert len(names) == len(set(names)) == state_bounds(env.scenario)[0].size
    assert names[:5] == [
        *("food_0.position.x", "food_0.position.y", "food_0.velocity.x", "food_0.velocity.y"),
        "food_1.position.x",
    ]
    assert "victim_1.task.task_2" in names


def test_needs_are_counted() -> None:
    env = BatchEnv(scenario(1.0, "discs", False, False, 1.0), 1)
    _, high = observation_bounds(env.scenario)
    found = dict(zip(env.observation_names(), high, strict=True))
    assert (found["victim_0.need.food"], found["victim_0.need.information"]) == (2, 1)


def test_a_robot_that_is_hit_may_be_faster_than_its_limit() -> None:
    """The bound must not be the speed limit: a heavy robot pushes a light one past it."""
    pair = [
        Robot(name="heavy_0", kind="h", abilities=("a",), max_speed_mps=2.0, mass_kg=40.0),
        Robot(name="light_0", kind="l", abilities=("a",), max_speed_mps=0.1, mass_kg=0.5),
    ]
    world = Scenario(
        robots=(pair[0].replace(drive_force_n=4e3), pair[1]),
        tasks=(Task(name="t", needs=("a",)),),
        engine="discs",
    )
    env = BatchEnv(world, 1, autoreset="disabled")
    env.reset()
    env.set_motion([[[-0.3, 0.0], [0.0, 0.0]]], np.zeros((1, 2, 2)))
    fastest = 0.0
    for _ in range(5):
        env.step([[1, 0]])
        fastest = max(fastest, float(env.velocities()[0, 1, 0]))
    assert fastest > 1.0
    assert fastest <= observation_bounds(world)[1][2]
