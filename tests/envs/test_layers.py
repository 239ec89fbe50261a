"""Layers and set velocities as Python sees them: who influences whom, and what is refused."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from innerattn.config import Obstacle, Robot, Scenario, Task
from innerattn.envs import BatchEnv, parallel_env
from innerattn.errors import ConfigError
from innerattn.evaluate.play import run_episodes
from innerattn.policies import scripted_policy

ENVS = 3
LAYERS = ("ground", "air", "ground", "air", "air")


def team(**values: Any) -> tuple[Robot, ...]:
    """Five robots of two layers in turn, unlike in size and weight."""
    common = {"kind": "any", "abilities": ("lift",), "max_speed_mps": 1.5} | values
    return tuple(
        Robot(
            name=f"robot_{index}",
            layer=layer,
            mass_kg=1.0 + 0.5 * index,
            radius_m=0.06 + 0.01 * index,
            **common,
        )
        for index, layer in enumerate(LAYERS)
    )


def world(robots: tuple[Robot, ...], **values: object) -> Scenario:
    """A narrow world; a disc in its middle blocks the ground."""
    disc = Obstacle(shape="disc", radius_m=0.1, position_m=(0.0, 0.0), layers=("ground",))
    grounded = any(robot.layer == "ground" for robot in robots)
    common = {
        "robots": robots,
        "tasks": (Task(name="task", needs=("lift",)),),
        "obstacles": (disc,) if grounded else (),
        "arena_half_width_m": 0.5,
        "spawn_clearance_m": 0.0,
        "episode_steps": 1_000,
    }
    return Scenario().replace(**common | values)


@pytest.mark.parametrize("engine", ["rapier", "discs"])
@pytest.mark.parametrize("drive", ["force", "velocity"])
@given(seed=st.integers(0, 2**32))
def test_a_layer_moves_as_if_it_were_alone(engine: str, drive: str, seed: int) -> None:
    whole = BatchEnv(world(team(drive=drive), engine=engine), ENVS, seed=seed, num_threads=1)
    whole.reset()
    parts = []
    for layer in ("ground", "air"):
        own = [index for index, name in enumerate(LAYERS) if name == layer]
        robots = tuple(team(drive=drive)[index] for index in own)
        part = BatchEnv(world(robots, engine=engine), ENVS, seed=seed, num_threads=1)
        part.reset()
        part.set_motion(whole.positions()[:, own], whole.velocities()[:, own])
        parts.append((own, part))
    rng = np.random.default_rng(seed)
    for _ in range(30):
        actions = rng.integers(0, 5, (ENVS, len(LAYERS)))
        whole.step(actions)
        for own, part in parts:
            part.step(actions[:, own])
            assert (part.positions() == whole.positions()[:, own]).all()
            assert (part.velocities() == whole.velocities()[:, own]).all()


@pytest.mark.parametrize("engine", ["rapier", "discs"])
def test_robots_of_a_layer_stay_apart_and_others_pass(engine: str) -> None:
    env = BatchEnv(world(team(), engine=engine), 40, seed=1, num_threads=1)
    env.reset()
    rng = np.random.default_rng(1)
    radii = np.array([robot.radius_m for robot in env.scenario.robots])
    reach = radii[:, None] + radii
    same = np.array(LAYERS)[:, None] == np.array(LAYERS)
    same &= ~np.eye(len(LAYERS), dtype=bool)
    ground = np.array(LAYERS) == "ground"
    passed = over = 0
    for _ in range(60):
        env.step(rng.integers(0, 5, (40, len(LAYERS))))
        at = env.positions().astype(np.float64)
        depth = reach - np.linalg.norm(at[:, :, None] - at[:, None], axis=-1)
        least = np.minimum(radii[:, None], radii)
        assert (depth <= 0.05 * least)[:, same].all()
        passed += int((depth > least)[:, ~same & ~np.eye(len(LAYERS), dtype=bool)].sum())
        inside = radii + 0.1 - np.linalg.norm(at, axis=-1)
        assert (inside <= 0.05 * radii)[:, ground].all()
        over += int((inside > radii)[:, ~ground].sum())
    assert passed > 100
    assert over > 20


def test_one_layer_by_another_name_changes_nothing() -> None:
    plain = Scenario.preset("mixed")
    robots = tuple(robot.replace(layer="air") for robot in plain.robots)
    one, two = (
        BatchEnv(scenario, ENVS, seed=5) for scenario in (plain, plain.replace(robots=robots))
    )
    assert (one.reset() == two.reset()).all()
    assert one.observation_names() == two.observation_names()
    rng = np.random.default_rng(5)
    for _ in range(60):
        actions = rng.integers(0, 5, (ENVS, 4))
        assert (one.step(actions).obs == two.step(actions).obs).all()


def test_a_copy_goes_on_in_the_same_way() -> None:
    preset = Scenario.preset("air-ground")
    env, other = BatchEnv(preset, ENVS, seed=3), BatchEnv(preset, ENVS, seed=4)
    rng = np.random.default_rng(1)
    env.reset()
    for _ in range(10):
        env.step(rng.integers(0, 5, (ENVS, 4)))
    other.restore(env.snapshot())
    for _ in range(40):
        actions = rng.integers(0, 5, (ENVS, 4))
        assert (other.step(actions).obs == env.step(actions).obs).all()


def test_continuous_actions_set_the_velocity_and_are_clipped_to_its_limit() -> None:
    first, *_ = Scenario().robots
    robot = first.replace(drive="velocity", start_m=(0.0, 0.0))
    values = {"robots": [robot], "tasks": [{"name": "t", "needs": ["food"]}]}
    env = BatchEnv(Scenario.model_validate({**values, "actions": "continuous"}), 1)
    env.reset()
    for action, wanted in (
        ((0.5, -0.25), (0.5, -0.25)),
        ((1.0, -1.0), (0.5**0.5, -(0.5**0.5))),
        ((0.0, 0.0), (0.0, 0.0)),
    ):
        before = env.positions()[0, 0]
        env.step(np.array([[action]], np.float32))
        np.testing.assert_allclose(env.velocities()[0, 0], wanted, atol=1e-6)
        np.testing.assert_allclose(
            env.positions()[0, 0] - before, 0.1 * np.array(wanted), atol=1e-6
        )


def test_the_preset_is_mixed_with_flying_food() -> None:
    preset, mixed = Scenario.preset("air-ground"), Scenario.preset("mixed")
    assert preset.layers == ("ground", "air")
    grounded = [robot.replace(layer="ground") for robot in preset.robots]
    assert preset.replace(robots=tuple(grounded), obstacles=()) == mixed
    assert {robot.kind for robot in preset.robots if robot.layer == "air"} == {"food"}
    assert not any(one.blocks("air") for one in preset.obstacles)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_scripts_play_where_velocities_are_set(actions: str) -> None:
    robots = tuple(one.replace(drive="velocity") for one in Scenario.preset("air-ground").robots)
    scenario = Scenario.preset("air-ground").replace(robots=robots, actions=actions, obstacles=())
    rescues = {
        name: len(run_episodes(scripted_policy(name, scenario), scenario, 100, 1).rescues)
        for name in ("random", "greedy", "hungarian", "planner")
    }
    assert min(rescues["greedy"], rescues["hungarian"], rescues["planner"]) > 200, rescues
    assert rescues["random"] < 100, rescues


def test_views_play_with_layers() -> None:
    env = parallel_env("air-ground")
    obs, _ = env.reset(seed=1)
    assert all(env.observation_space(agent).contains(row) for agent, row in obs.items())


def test_policies_for_any_team_take_layers_and_no_set_velocities() -> None:
    from innerattn.train.teams.sheet import TeamSheet

    layered = Scenario.preset("air-ground")
    TeamSheet(layered, BatchEnv(layered, 1).observation_names())
    first, *others = layered.robots
    quick = layered.replace(robots=(first.replace(drive="velocity"), *others))
    with pytest.raises(ConfigError, match=r"robots\[0\].drive = 'velocity': must be 'force'; poli"):
        TeamSheet(quick, BatchEnv(quick, 1).observation_names())


def test_helpers_of_different_layers_meet_where_bodies_are_large() -> None:
    robots = [robot.replace(radius_m=0.3) for robot in Scenario().robots]
    wide = {"arena_half_width_m": 2.0, "spawn_clearance_m": 0.0}
    with pytest.raises(ValueError, match=r"rescue_radius_m = 0.15: must be at least 0.300"):
        Scenario.model_validate({"robots": robots, **wide})
    flying = [robot.replace(layer="air") for robot in robots[:2]]
    assert Scenario.model_validate({"robots": [*flying, *robots[2:]], **wide}).layers
