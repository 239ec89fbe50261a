"""Ways around obstacles against those of a graph of visible places."""

from __future__ import annotations

import numpy as np
import pytest
from plain_ways import is_clear, shortest

from innerattn import _core
from innerattn.config import Scenario
from innerattn.envs import BatchEnv

RADIUS = 0.05
WALL = {"shape": "box", "half_extents_m": [0.04, 0.4]}
TOP, LOW = {**WALL, "position_m": [0.0, 0.6]}, {**WALL, "position_m": [0.0, -0.6]}


def scenario(obstacles: list[dict[str, object]], **keys: object) -> Scenario:
    """The preset mixed among obstacles, where robots may start beside victims."""
    return Scenario.preset("mixed").replace(obstacles=obstacles, **keys)


def random_obstacles(rng: np.random.Generator) -> list[dict[str, object]]:
    discs = [
        {"shape": "disc", "radius_m": float(rng.uniform(0.05, 0.2))}
        for _ in range(rng.integers(0, 3))
    ]
    boxes = [
        {"shape": "box", "half_extents_m": rng.uniform(0.03, 0.25, 2).tolist()}
        for _ in range(rng.integers(1, 4))
    ]
    return [*discs, *boxes]


@pytest.mark.parametrize(
    "seed", [0, 1, 2, *(pytest.param(n, marks=pytest.mark.slow) for n in (3, 4))]
)
def test_lengths_are_those_of_a_graph_of_visible_places(seed: int) -> None:
    rng = np.random.default_rng(seed)
    given = scenario(random_obstacles(rng), rescue_radius_m=0.06)  # it reaches through no box
    env = BatchEnv(given, 1, seed=seed, num_threads=1)
    env.reset()
    places, goals = env.obstacles(), np.full((1, 4, 1, 2), 2.0, np.float32)
    solids = list(zip(given.obstacles, places[0].astype(np.float64), strict=True))
    for robot in range(4):
        while not is_clear(solids, RADIUS, 1.0, *[goals[0, robot, 0].astype(np.float64)] * 2):
            goals[0, robot, 0] = rng.uniform(-0.94, 0.94, 2)
    routes = _core.Routes(given.rules)
    lengths, turns = routes.ways(places, env.positions(), goals)
    for robot in range(4):
        start, goal = (
            one.astype(np.float64) for one in (env.positions()[0, robot], goals[0, robot, 0])
        )
        exact = shortest(solids, RADIUS, 1.0, start, goal)
        assert 0.98 * exact - 0.02 <= lengths[0, robot, 0] <= 1.06 * exact + 0.03
        # Whoever drives from turn to turn arrives, and never much nearer to an obstacle.
        at, driven = start, 0.0
        for _ in range(40):
            turn = routes.ways(places, np.tile(at, (1, 4, 1)).astype(np.float32), goals)[1][
                0, robot, 0
            ]
            turn = turn.astype(np.float64)
            assert is_clear(solids, 0.6 * RADIUS, 2.0, at, turn)
            driven, at = driven + float(np.linalg.norm(turn - at)), turn
            if np.array_equal(at, goal):
                break
        assert np.array_equal(at, goal)
        assert driven <= 1.06 * exact + 0.05
    assert np.isfinite(turns).all()


def test_where_the_way_is_clear_it_is_straight() -> None:
    given = scenario([TOP, LOW])
    at = np.array([[[-0.5, 0.0], [-0.5, 0.5], [0.5, -0.5], [0.9, 0.9]]], np.float32)
    goals = np.array([[[0.5, 0.0], [-0.9, -0.9], [0.9, 0.5], [0.9, 0.9]]], np.float32)
    places = np.array([[[0.0, 0.6], [0.0, -0.6]]], np.float32)
    lengths, turns = _core.Routes(given.rules).ways(places, at, goals[:, :, None])
    np.testing.assert_allclose(lengths[..., 0], np.linalg.norm(goals - at, axis=-1), rtol=1e-6)
    np.testing.assert_array_equal(turns[:, :, 0], goals)


def test_a_gap_that_is_too_narrow_is_none_but_for_who_is_near_enough() -> None:
    """Bodies of 0.1 m and a gap of 0.08 m; the rescue radius reaches through the wall."""
    walls = [{**WALL, "half_extents_m": [0.04, 0.46], "position_m": [0.0, y]} for y in (0.5, -0.5)]
    given = scenario(walls)
    places = np.array([[[0.0, 0.5], [0.0, -0.5]]], np.float32)
    at = np.tile(np.array([-0.5, 0.0], np.float32), (1, 4, 1))
    goals = np.tile(np.array([[0.5, 0.0], [0.05, 0.0]], np.float32), (1, 4, 1, 1))
    lengths, _ = _core.Routes(given.rules).ways(places, at, goals)
    assert np.isinf(lengths[..., 0]).all()
    np.testing.assert_allclose(lengths[..., 1], 0.55, atol=0.05)


def test_layers_that_nothing_blocks_go_straight() -> None:
    robots = [
        {**robot.model_dump(), "layer": layer}
        for robot, layer in zip(
            Scenario.preset("mixed").robots, ["air", "ground", "ground", "ground"], strict=True
        )
    ]
    given = scenario([{**TOP, "layers": ["ground"]}], robots=robots)
    at = np.tile(np.array([-0.5, 0.8], np.float32), (1, 4, 1))
    goals = np.tile(np.array([0.5, 0.8], np.float32), (1, 4, 1, 1))
    lengths, _ = _core.Routes(given.rules).ways(np.array([[[0.0, 0.6]]], np.float32), at, goals)
    np.testing.assert_allclose(lengths[0, 0], 1.0, rtol=1e-6)
    assert (lengths[0, 1:] > 1.3).all()


def test_what_is_left_after_a_move_ends_at_an_obstacle() -> None:
    given = scenario([TOP, LOW])
    places = np.array([[[0.0, 0.6], [0.0, -0.6]]], np.float32)
    at = np.tile(np.array([-0.15, 0.6], np.float32), (1, 4, 1))
    goals = np.tile(np.array([0.5, 0.6], np.float32), (1, 4, 1))
    moves = np.array([[0.0, 0.0], [0.4, 0.0], [-0.2, 0.0], [0.0, -0.2], [0.0, 9.0]], np.float32)
    left = _core.Routes(given.rules).left(places, at, at[:, :, None] + moves, goals)[0, 0]
    assert left.argmin() == 3
    assert left[1] > left[3], "beyond the wall it would be nearer, if it came there"
    assert left[2] > left[0]
    assert np.isfinite(left).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("obstacles", np.zeros((1, 3, 2), np.float32)),
        ("positions", np.zeros((1, 3, 2), np.float32)),
        ("goals", np.zeros((1, 3, 1, 2), np.float32)),
        ("goals", np.full((1, 4, 1, 2), np.nan, np.float32)),
    ],
)
def test_wrong_arrays_are_refused(name: str, value: np.ndarray) -> None:
    given = scenario([TOP, LOW])
    arrays = {
        "obstacles": np.zeros((1, 2, 2), np.float32),
        "positions": np.zeros((1, 4, 2), np.float32),
        "goals": np.zeros((1, 4, 1, 2), np.float32),
    }
    with pytest.raises(ValueError, match=name):
        _core.Routes(given.rules).ways(**{**arrays, name: value})


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
@pytest.mark.parametrize("drive", ["force", "unicycle"])
def test_scripts_drive_around_a_wall(actions: str, drive: str) -> None:
    """Straight on, robots would stand at the wall for ever."""
    from innerattn.evaluate import run_episodes
    from innerattn.policies.scripted.dispatch import scripted_policy

    robots = [
        {**robot.model_dump(), "drive": drive, "start_m": [-0.6, y]}
        for robot, y in zip(Scenario.preset("mixed").robots, (-0.3, -0.1, 0.1, 0.3), strict=True)
    ]
    given = scenario(
        [{**WALL, "half_extents_m": [0.03, 0.5], "position_m": [0.0, 0.0]}],
        robots=robots,
        actions=actions,
        victim_places_m=[[0.5, -0.1], [0.5, 0.1]],
        situation="single",
        end_when_rescued=1,
        episode_steps=80,
    )
    for name in ("greedy", "hungarian", "planner"):
        found = run_episodes(scripted_policy(name, given), given, 4, 1, num_threads=1)
        np.testing.assert_array_equal(found.rescue_counts(), 1)
