"""Wheels in scripts: their law is that of the worlds, and steering brings robots to rest."""

from typing import Any

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy
from innerattn.policies.policy import pointing
from innerattn.policies.scripted.steering import Steering
from innerattn.policies.scripted.wheels import Wheels

DRIVES = ("unicycle", "differential")
KINDS = ("discrete", "continuous")


def team(drive: str, **fields: Any) -> Scenario:
    mixed = Scenario.preset("mixed")
    robots = tuple(robot.replace(drive=drive) for robot in mixed.robots)
    return mixed.replace(robots=robots, **fields)


@pytest.mark.parametrize("actions", KINDS)
@pytest.mark.parametrize("drive", DRIVES)
def test_the_law_is_that_of_the_worlds(drive: str, actions: str) -> None:
    scenario = team(drive, actions=actions, engine="none", arena_half_width_m=20.0)
    env, wheels, rng = BatchEnv(scenario, 30, seed=2), Wheels(scenario), np.random.default_rng(2)
    env.reset()
    env.set_motion(0.1 * env.positions(), env.velocities())  # far from the walls
    faults = env.fault_state()
    faults["motor_gain"] = rng.uniform(0.3, 1.0, (30, 4))
    faults["speed_limit"] = rng.uniform(0.3, 1.0, (30, 4))
    faults["heading_bias"] = rng.uniform(-1.0, 1.0, (30, 4))
    env.set_faults(faults)
    gain, cap, bias = (
        faults[k].astype(float) for k in ("motor_gain", "speed_limit", "heading_bias")
    )
    for _ in range(20):
        headings = pointing(env)
        assert headings is not None
        if actions == "discrete":
            done = rng.integers(0, 5, (30, 4))
        else:
            done = rng.uniform(-1, 1, (30, 4, 2)).astype(np.float32)
        now = wheels.rolling(env.velocities().astype(float), headings.astype(float), bias)
        then = wheels.after(now, wheels.shares(done), gain, cap)
        wanted = wheels.velocities(headings[..., 0].astype(float), then, bias)
        env.step(done)
        np.testing.assert_allclose(env.velocities(), wanted, atol=1e-5)
        np.testing.assert_allclose(env.turn_rates(), then.turn_rate, atol=1e-4)


@pytest.mark.parametrize("drive", DRIVES)
def test_continuous_actions_are_those_that_ask_for_the_shares(drive: str) -> None:
    wheels = Wheels(team(drive, actions="continuous"))
    rng = np.random.default_rng(3)
    shares = rng.uniform(-0.5, 0.5, (50, 4, 2))
    np.testing.assert_allclose(wheels.shares(wheels.actions(shares)), shares, atol=1e-6)
    both = np.ones((1, 4, 2))  # as fast as it turns
    found = wheels.shares(wheels.actions(both))
    np.testing.assert_allclose(found[..., 1], 1.0)
    np.testing.assert_allclose(found[..., 0], 1.0 if drive == "unicycle" else 0.0)


@pytest.mark.parametrize("actions", KINDS)
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("knows", [False, True])
def test_robots_arrive_about_when_they_are_expected_and_rest_there(
    drive: str, actions: str, knows: bool
) -> None:
    """From any heading, to places in all directions; half of the robots are faulty if known."""
    open_air = {"engine": "none", "arena_half_width_m": 3.0, "episode_steps": 100}
    scenario = team(drive, actions=actions, **open_air)
    env, rng = BatchEnv(scenario, 50, seed=1), np.random.default_rng(1)
    env.reset()
    faults = env.fault_state()
    if knows:
        half = rng.random((50, 4)) < 0.5
        for kind, value in (("motor_gain", 0.6), ("speed_limit", 0.5), ("heading_bias", 0.7)):
            faults[kind] = np.where(half, np.float32(value), faults[kind])
        env.set_faults(faults)
    known = faults if knows else None
    env.set_motion(rng.uniform(-0.5, 0.5, (50, 4, 2)), np.zeros((50, 4, 2)))
    steering = Steering(scenario)
    targets = rng.uniform(-1.5, 1.5, (50, 4, 2))
    expected = np.stack(
        [
            steering.arrival_times(
                env.positions(), env.velocities(), targets[:, [robot]], known, pointing(env)
            )[:, robot, 0]
            for robot in range(4)
        ],
        1,
    )
    arrived = np.full((50, 4), np.inf)
    for step in range(80):
        away = np.linalg.norm(env.positions() - targets, axis=-1)
        arrived = np.where(
            away <= scenario.rescue_radius_m, np.minimum(arrived, 0.1 * step), arrived
        )
        where = env.positions(), env.velocities(), targets
        env.step(steering.actions(*where, known, pointing(env)))
    assert np.isfinite(arrived).all()
    late = arrived - expected
    assert (late < 1.0).all(), late.max()
    assert abs(np.median(late)) < 0.25, np.median(late)
    assert (np.linalg.norm(env.positions() - targets, axis=-1) <= scenario.rescue_radius_m).all()
    healthy = faults["motor_gain"] == 1.0
    assert (np.linalg.norm(env.velocities(), axis=-1) < 0.05)[healthy].all()


def test_arrival_times_count_turns_to_the_nearer_end() -> None:
    steering = Steering(team("unicycle"))
    still, places = np.zeros((1, 4, 2)), [[[0.65, 0.0]]]
    headings = np.zeros((1, 4, 2))
    headings[0, :, 0] = [0.0, np.pi, 0.5, np.pi - 0.5]
    found = steering.arrival_times(still, still, places, headings=headings)[0, :, 0]
    # Half a metre at 1 and 1.5 m/s, a start at 5 m/s2, and half a radian at 4 rad/s.
    start = [0.5 + 0.05, 0.5 + 0.05, 0.5 / 1.5 + 0.1, 0.5 / 1.5 + 0.1]
    np.testing.assert_allclose(found, np.add(start, [0.0, 0.0, 0.125, 0.125]), atol=1e-9)
    with pytest.raises(ValueError, match="headings = None: must be given where robots have wheels"):
        steering.actions(still, still, np.ones((1, 4, 2)))


@pytest.mark.parametrize("actions", KINDS)
@pytest.mark.parametrize("drive", DRIVES)
def test_scripts_rescue_with_wheels(drive: str, actions: str) -> None:
    """Most of what the same team does whose velocity is set at once, without a turn."""
    for name in ("greedy", "hungarian", "planner"):
        on_wheels, at_once = (
            len(run_episodes(scripted_policy(name, one), one, 150, 1).rescues)
            for one in (team(drive, actions=actions), team("velocity", actions=actions))
        )
        assert on_wheels > 0.62 * at_once, (name, on_wheels, at_once)
