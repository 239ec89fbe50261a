"""Arenas of several sizes: each is drawn to scale, is played in, and holds what is in it."""

import numpy as np
import pytest

from innerattn.config import Obstacle, Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate import run_episodes, scripted_policy
from innerattn.report.scenario_map import scenario_map

HALF_WIDTHS = pytest.mark.parametrize("half", [0.5, 1.0, 6.0])
INNER = 61
"""Characters of a row between the walls of the drawing."""


def world(half: float, **keys: object) -> Scenario:
    return Scenario(arena_half_width_m=half, **keys)


@HALF_WIDTHS
def test_it_is_drawn_to_scale(half: float) -> None:
    """A box of fixed size, and one that grows with the arena."""
    sides = ((0.25, 0.25), (half / 2, half / 2))
    widths = []
    for side in sides:
        box = Obstacle(shape="box", half_extents_m=side, position_m=(0.0, 0.0))
        drawing = scenario_map(world(half, obstacles=(box,), max_victims=1))
        rows = [line[1:-1] for line in drawing.splitlines() if line.startswith("|")]
        assert {len(row) for row in rows} == {INNER}
        widths.append(max(row.count("#") for row in rows))
        assert f"\n{2 * half:g} m from wall to wall\n" in drawing
    assert widths[0] == pytest.approx(INNER * 0.25 / half, abs=1)
    assert widths[1] == pytest.approx(INNER / 2, abs=1)


@HALF_WIDTHS
@pytest.mark.parametrize("engine", ["rapier", "discs"])
def test_it_holds_robots_that_drive_against_its_walls(half: float, engine: str) -> None:
    scenario = world(half, engine=engine, actions="continuous", episode_steps=200)
    draws = np.random.default_rng(0)
    radius = np.array([robot.radius_m for robot in scenario.robots])
    with BatchEnv(scenario, 16, seed=1, num_threads=1) as env:
        env.reset()
        farthest = 0.0
        for step in range(150):
            if step % 30 == 0:
                forces = draws.choice([-1.0, 1.0], (16, 4, 2)).astype(np.float32)
            env.step(forces)
            reach = np.abs(env.positions()).max(axis=2) + radius
            farthest = max(farthest, float(reach.max()))
            victims = env.victims()
            for axis in "xy":
                assert np.abs(victims[axis][victims["present"]]).max() <= half - 0.1 + 1e-6
    assert half - 0.01 < farthest < half + 0.001


@HALF_WIDTHS
def test_a_script_rescues_in_it(half: float) -> None:
    scenario = world(half, episode_steps=200)
    script = scripted_policy("hungarian", scenario)
    assert run_episodes(script, scenario, 10, seed=2, num_threads=1).rescue_counts().mean() > 3.0
