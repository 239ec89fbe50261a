"""A map against obstacles at the same places, wherever worlds are played, measured or shown."""

from __future__ import annotations

import numpy as np
import pytest

from innerattn.config import Map, Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate import run_episodes
from innerattn.measures.moments import blocked_between
from innerattn.policies import scripted_policy
from innerattn.policies.scripted.routes import Routes
from innerattn.report.reachability import closed_off
from innerattn.report.scenario_map import scenario_map
from innerattn.report.scenario_words import scenario_words
from innerattn.report.worlds import worlds_document


def random_map(seed: int, **keys: object) -> Scenario:
    """Some solid blocks in an arena with room between them."""
    rng = np.random.default_rng(seed)
    cells = np.zeros((20, 20), bool)
    for _ in range(rng.integers(2, 9)):
        row, column = rng.integers(0, 18, 2)
        height, width = rng.integers(1, 6, 2)
        cells[row : row + height, column : column + width] = True
    layers = [None, ("ground",)][seed % 2]
    rows = tuple("".join("#" if cell else "." for cell in row) for row in cells)
    robots = [
        robot.replace(layer="air" if index == 1 and layers else "ground")
        for index, robot in enumerate(Scenario.preset("mixed").robots)
    ]
    table = {"arena_half_width_m": 2.0, "robots": robots, "occlusion": True, "rescue_radius_m": 0.3}
    return Scenario.preset("mixed").replace(**table | {"map": Map(rows=rows, layers=layers)} | keys)


def with_obstacles(scenario: Scenario) -> Scenario:
    """The same with an obstacle in place of each box of the map."""
    return scenario.replace(map=None, obstacles=scenario.map_boxes)


@pytest.mark.parametrize("seed", range(12))
def test_boxes_cover_the_solid_cells_alone(seed: int) -> None:
    scenario = random_map(seed)
    assert scenario.map is not None
    covered = np.zeros((20, 20), int)
    for box in scenario.map_boxes:
        (x, y), (width, height) = box.position_m or (0, 0), box.half_extents_m or (0, 0)
        left, right = round((x - width + 2.0) * 5), round((x + width + 2.0) * 5)
        top, bottom = round((2.0 - y - height) * 5), round((2.0 - y + height) * 5)
        covered[top:bottom, left:right] += 1
        assert box.layers == scenario.map.layers
    np.testing.assert_array_equal(covered, scenario.map.solid.astype(int))


@pytest.mark.parametrize("engine", ["discs", "rapier"])
@pytest.mark.parametrize("seed", range(6))
def test_worlds_begin_alike_and_go_on_alike(seed: int, engine: str) -> None:
    """Contacts of several solids are solved in another order, so later steps are only near."""
    scenario = random_map(seed, engine=engine, episode_steps=12)
    boxed = with_obstacles(scenario)
    rng = np.random.default_rng(seed)
    with BatchEnv(scenario, 16, seed=seed) as one, BatchEnv(boxed, 16, seed=seed) as other:
        np.testing.assert_array_equal(one.reset()[0], other.reset()[0])
        np.testing.assert_array_equal(one.last_seen()[0], other.last_seen()[0])
        for _ in range(11):
            actions = rng.integers(0, 5, (16, 4))
            one.step(actions)
            other.step(actions)
        apart = np.abs(one.positions() - other.positions()).max(-1)
        assert np.mean(apart < 1e-3) > 0.97
        assert np.abs(one.velocities()).max() > 0.1


@pytest.mark.parametrize("seed", range(6))
def test_ways_and_what_is_closed_off_are_the_same(seed: int) -> None:
    scenario = random_map(seed, victim_places_m=[])
    boxed = with_obstacles(scenario)
    assert list(closed_off(scenario)) == list(closed_off(boxed))
    with BatchEnv(scenario, 8, seed=seed) as env, BatchEnv(boxed, 8, seed=seed) as other:
        env.reset()
        other.reset()
        at = env.positions()
        goals = np.roll(at, 1, 1)[:, :, None]
        ways = Routes(scenario).ways(env.obstacles(), at, goals)
        same = Routes(boxed).ways(other.obstacles(), at, goals)
        for found, expected in zip(ways, same, strict=True):
            np.testing.assert_allclose(found, expected, atol=2e-6)


def test_a_script_drives_around_a_wall_of_cells() -> None:
    rows = [
        "........",
        "........",
        "...#....",
        "...#....",
        "...#....",
        "...#....",
        "...#....",
        "........",
    ]
    scenario = Scenario.preset("double").replace(
        map=Map(rows=tuple(rows)), victim_places_m=[[-0.8, -0.5], [0.8, -0.5], [0.8, 0.2]],
        episode_steps=80, rescue_radius_m=0.2,
    )  # fmt: skip
    record = run_episodes(scripted_policy("hungarian", scenario), scenario, 30, 3)
    straight = scenario.replace(map=None)
    free = run_episodes(scripted_policy("hungarian", straight), straight, 30, 3)
    assert len(record.rescues) > 0.6 * len(free.rescues) > 30


def test_who_stands_at_a_cell_is_blocked_as_at_an_obstacle() -> None:
    scenario = random_map(1, engine="discs", episode_steps=30)
    boxed = with_obstacles(scenario)
    rng = np.random.default_rng(1)
    count = 0
    with BatchEnv(scenario, 60, seed=1) as env:
        env.reset()
        faults = env.fault_state()
        places = np.tile([box.position_m for box in scenario.map_boxes], (60, 1, 1))
        for _ in range(20):
            before, velocities = env.positions(), env.velocities()
            actions = rng.integers(1, 5, (60, 1)).repeat(4, 1)
            env.step(actions)
            moved = (before, env.positions(), velocities, actions, faults)
            found = blocked_between(scenario, *moved, np.zeros((60, 0, 2), np.float32))
            np.testing.assert_array_equal(found, blocked_between(boxed, *moved, places))
            count += int(found.sum())
    assert count > 50, count


def test_pages_and_drawings_show_solid_cells() -> None:
    scenario = random_map(1)
    document = worlds_document(scenario)["map"]
    assert document["passed_by"] == ["air"]
    assert [tuple(box[:2]) for box in document["boxes"]] == [
        one.position_m for one in scenario.map_boxes
    ]
    assert worlds_document(with_obstacles(scenario))["map"] is None
    assert "%  an obstacle that robots of some layers pass" in scenario_map(scenario)
    thin = Scenario(
        map=Map(rows=tuple("#" + 99 * "." if row == 50 else 100 * "." for row in range(100)))
    )
    drawing = scenario_map(thin)
    assert drawing.splitlines()[16][1] == "#", "a cell is seen even if no character has its centre"
    assert "#  an obstacle or a solid cell" in drawing
    assert "Solid cells hide what is behind them." in scenario_words(scenario)
    assert "Obstacles hide what is behind them." in scenario_words(with_obstacles(scenario))
