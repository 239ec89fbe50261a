"""Robots on wheels through Python: columns, bounds, views, frames, copies and what refuses them."""

import copy
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.config.run import RunConfig
from innerattn.envs import BatchEnv, parallel_env
from innerattn.envs.bounds import observation_bounds, state_bounds
from innerattn.errors import ConfigError
from innerattn.nn import NUM_ELEMENTS, SquareSymmetry
from innerattn.report.scenario_words import scenario_words
from innerattn.train.build import build_learner
from innerattn.train.columns import entity_columns, state_columns, vector_columns
from innerattn.train.teams.sheet import TeamSheet

ENVS = 20
DRIVES = ("unicycle", "differential", "force", "velocity")


def wheeled(**fields: Any) -> Scenario:
    """The paper's team, each with a drive of its own."""
    mixed = Scenario.preset("mixed")
    robots = [one.replace(drive=drive) for one, drive in zip(mixed.robots, DRIVES, strict=True)]
    return mixed.replace(robots=tuple(robots), **fields)


def drawn(scenario: Scenario, rng: np.random.Generator) -> NDArray[Any]:
    if scenario.actions == "continuous":
        return rng.uniform(-1, 1, (ENVS, 4, 2)).astype(np.float32)
    return rng.integers(0, 5, (ENVS, 4))


def walked(scenario: Scenario, steps: int = 40) -> tuple[BatchEnv, NDArray[np.float32]]:
    """Worlds after some steps, and the rows of all of these (steps, E, R, D)."""
    env, rng = BatchEnv(scenario, ENVS, seed=4, num_threads=1), np.random.default_rng(4)
    rows = [env.reset()]
    rows += [env.step(drawn(scenario, rng)).obs for _ in range(steps)]
    return env, np.stack(rows)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_columns_and_states_say_where_robots_point(actions: Any) -> None:
    env, rows = walked(wheeled(actions=actions))
    names, row = env.observation_names(), rows[-1]
    headings, rates = env.headings(), env.turn_rates()
    assert headings.shape == rates.shape == (ENVS, 4)
    assert headings.dtype == rates.dtype == np.float32
    assert (abs(headings) <= np.float32(np.pi)).all()
    assert (headings[:, 2:] == 0).all()
    assert (rates[:, 2:] == 0).all()
    ahead = np.stack([np.cos(headings), np.sin(headings)], -1) * [[1], [1], [0], [0]]
    own = [names.index(f"own.heading.{axis}") for axis in "xy"]
    np.testing.assert_allclose(row[..., own], ahead, atol=1e-6)
    np.testing.assert_array_equal(row[..., names.index("own.turn_rate")], rates)
    mate = [names.index(f"teammate_0.heading.{axis}") for axis in "xy"]
    np.testing.assert_allclose(row[:, 1, mate], ahead[:, 0], atol=1e-6)
    place = [names.index(f"victim_0.relative_position.{axis}") for axis in "xy"]
    x, y = np.moveaxis(row[..., place], -1, 0)
    for name, wanted in (
        ("ahead", ahead[..., 0] * x + ahead[..., 1] * y),
        ("left", ahead[..., 0] * y - ahead[..., 1] * x),
    ):
        np.testing.assert_allclose(row[..., names.index(f"victim_0.{name}")], wanted, atol=1e-6)
    state, of_state = env.state(), env.state_names()
    columns = [of_state.index(f"food_0.{one}") for one in ("heading.x", "heading.y", "turn_rate")]
    wanted = np.concatenate([ahead[:, 0], rates[:, :1]], -1)
    np.testing.assert_allclose(state[:, columns], wanted, atol=1e-6)
    for found, (low, high) in (
        (rows, observation_bounds(env.scenario)),
        (state, state_bounds(env.scenario)),
    ):
        assert found.shape[-1] == len(low)
        assert ((low <= found) & (found <= high)).all()


def test_worlds_without_wheels_have_no_such_columns() -> None:
    env = BatchEnv("mixed", 2)
    env.reset()
    assert (env.headings() == 0).all()
    words = ("heading", "turn_rate", "ahead", "left")
    assert not [
        name for name in env.observation_names() + env.state_names() if name.endswith(words)
    ]
    with pytest.raises(ValueError, match="no robot of this scenario has a heading"):
        env.set_headings(np.zeros((2, 4)))


def test_views_and_copies_play_with_wheels() -> None:
    view = parallel_env("mixed-wheels")
    found, _ = view.reset(seed=1)
    for robot, row in found.items():
        assert view.observation_space(robot).contains(row)
    env, _ = walked(wheeled())
    again, rng = copy.deepcopy(env), np.random.default_rng(1)
    for _ in range(20):
        actions = drawn(env.scenario, rng)
        assert (again.step(actions).obs == env.step(actions).obs).all()
    assert (again.headings() == env.headings()).all()
    assert again.snapshot() == env.snapshot()


def test_headings_are_put_and_motion_is_put_without_them() -> None:
    env, _ = walked(wheeled())
    angles = np.linspace(-3, 3, 4 * ENVS).reshape(ENVS, 4)
    env.set_headings(angles)
    np.testing.assert_allclose(env.headings()[:, :2], angles[:, :2], atol=1e-6)
    assert (env.headings()[:, 2:] == 0).all()
    assert (env.turn_rates() == 0).all()
    env.step(np.full((ENVS, 4), 3))
    before = env.headings()
    env.set_motion(env.positions(), env.velocities())
    assert (env.headings() == before).all()
    assert (env.turn_rates() == 0).all()
    for wrong, error, said in (
        (np.full((ENVS, 4), 3.2), ValueError, r"headings = 3.2 \(env 0, robot 0\): must be in"),
        (np.zeros((ENVS, 3)), ValueError, "shape"),
        (np.zeros((ENVS, 4), bool), TypeError, "headings"),
    ):
        with pytest.raises(error, match=said):
            env.set_headings(wrong)
    assert (env.headings() == before).all()


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_a_mirrored_world_goes_on_mirrored_with_mirrored_actions(actions: Any) -> None:
    """All eight turned worlds, without contacts: rows and actions turn as symmetries say."""
    scenario = wheeled(actions=actions, engine="none", arena_half_width_m=20.0)
    env, _ = walked(scenario, 5)
    rng = np.random.default_rng(8)
    names = env.observation_names()
    drives = [robot.drive for robot in scenario.robots]
    symmetry = SquareSymmetry(vector_columns(names), torch.device("cpu"), drives)
    image = env.snapshot()
    for element in range(NUM_ELEMENTS):
        env.restore(image)
        other = BatchEnv(scenario, ENVS, seed=4, num_threads=1)
        other.restore(image)
        elements = torch.full((ENVS, 4), element)

        def turned(vectors: NDArray[Any], element: int = element) -> NDArray[Any]:
            x, y = np.moveaxis(vectors, -1, 0)
            x, y = (-x if element & 1 else x), (-y if element & 2 else y)
            return np.stack([y, x] if element & 4 else [x, y], -1)

        angles = env.headings()
        ahead = turned(np.stack([np.cos(angles), np.sin(angles)], -1))
        for one in (env, other):  # both at rest
            one.set_motion(one.positions(), np.zeros((ENVS, 4, 2)))
        other.set_motion(turned(env.positions()), np.zeros((ENVS, 4, 2)))
        other.set_headings(np.arctan2(ahead[..., 1], ahead[..., 0]))
        victims = other.victims()
        places = turned(np.stack([victims["x"], victims["y"]], -1))
        victims["x"], victims["y"] = places[..., 0], places[..., 1]
        other.set_victims(victims)
        for _ in range(8):
            obs = torch.from_numpy(env.observe())
            np.testing.assert_allclose(
                other.observe(), symmetry.turn(obs, elements).numpy(), atol=2e-5
            )
            done = torch.from_numpy(drawn(scenario, rng))
            there = symmetry.turn_actions(done, elements)
            assert torch.equal(symmetry.turn_actions_back(there, elements), done)
            env.step(done.numpy())
            other.step(there.numpy())


def test_frames_bring_turned_rows_to_one_form() -> None:
    env, rows = walked(wheeled())
    for names, table, columns in (
        (env.observation_names(), rows.reshape(-1, rows.shape[-1]), vector_columns),
        (env.state_names(), env.state(), state_columns),
    ):
        obs = torch.from_numpy(table)
        symmetry = SquareSymmetry(columns(names), torch.device("cpu"))
        own = symmetry.turn(obs, symmetry.frame(obs))
        for element in range(NUM_ELEMENTS):
            turned = symmetry.turn(obs, torch.full((len(obs),), element))
            assert torch.equal(symmetry.turn(turned, symmetry.frame(turned)), own)
    assert entity_columns(env.observation_names()).width == rows.shape[-1]


def test_a_learner_in_frames_mirrors_what_wheels_do() -> None:
    """Rows that are mirrored get the mirrored action, to the bit."""
    config = RunConfig.model_validate(
        {
            "scenario": wheeled(),
            "train": {"method": "ppo-inner"},
            "network": {"symmetry": "canonical"},
        }
    )
    env, rows = walked(wheeled())
    learner = build_learner(config, env)
    obs = torch.from_numpy(rows[-1])
    drives = [robot.drive for robot in env.scenario.robots]
    symmetry = SquareSymmetry(vector_columns(env.observation_names()), obs.device, drives)
    plain = learner.act(obs, greedy=True)
    for element in range(NUM_ELEMENTS):
        elements = torch.full((ENVS, 4), element)
        found = learner.act(symmetry.turn(obs, elements), greedy=True)
        assert torch.equal(found, symmetry.turn_actions(plain, elements))
        if element.bit_count() % 2 == 0:  # a turn, and no mirror
            assert torch.equal(found[:, :2], plain[:, :2])


def test_info_says_what_actions_set() -> None:
    words = scenario_words(wheeled())
    assert "food_0: actions set the speed along a heading and the turn rate" in words
    assert "food_1: actions set the speeds of two wheels" in words
    assert "medical_0: actions set the velocity" in words
    assert "navigation_0: actions" not in words
    still = Scenario.preset("mixed-wheels")
    robots = tuple(one.replace(drive_force_n=0.0) for one in still.robots)
    doubts = scenario_words(still.replace(robots=robots))
    assert "navigation_0: cannot move" in doubts
    assert "food_0: cannot move" not in doubts


def test_the_preset_is_mixed_with_food_on_wheels() -> None:
    preset = Scenario.preset("mixed-wheels")
    assert {one.kind for one in preset.robots if one.has_wheels} == {"food"}
    plain = tuple(robot.replace(drive="force") for robot in preset.robots)
    assert preset.replace(robots=plain) == Scenario.preset("mixed")


def test_who_knows_forces_alone_refuses_wheels() -> None:
    scenario = wheeled()
    with pytest.raises(ConfigError, match=r"robots\[0\].drive = 'unicycle': must be 'force'; poli"):
        TeamSheet(scenario, BatchEnv(scenario, 1).observation_names())


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"max_turn_rad_s": 32.0},
            r"max_turn_rad_s = 32: must be at most 31.4159\d+ rad/s: no robo",
        ),
        ({"max_turn_rad_s": 0.0}, r"max_turn_rad_s = 0: must be in 0.01..=10000 rad/s"),
        ({"acceleration_m_s2": 0.0}, r"acceleration_m_s2 = 0: must be in 0.01..=100000 m/s\^2"),
        ({"turn_acceleration_rad_s2": -1.0}, r"turn_acceleration_rad_s2 = -1: must be in 0.01..="),
        (
            {"wheel_base_m": 0.11},
            r"wheel_base_m = 0.11: must be at most 0.1 m: both wheels are on it",
        ),
        ({"drive": "tracks"}, "drive"),
    ],
)
def test_wheels_that_are_none_are_refused(fields: dict[str, Any], message: str) -> None:
    first, *others = (robot.model_dump() for robot in wheeled().robots)
    with pytest.raises(ValueError, match=message):
        Scenario.model_validate({"robots": [{**first, **fields}, *others]})
