"""How deep robots of very unequal masses overlap under `rapier`: what docs/contacts.md says."""

import os
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from innerattn.config import Robot, Scenario
from innerattn.envs import BatchEnv

WORLDS, STEPS = 100, 100
LONGER = int(os.environ.get("INNERATTN_UNEQUAL_MASSES_TIMES", "1"))
"""How many times as many steps are played; 3 gives the numbers of the page."""
MAX_MASS_RATIO = 16.0
"""More is refused with rapier."""
PLAYS = ("random", "corner", "head-on", "chase")


def test_more_is_refused() -> None:
    message = r"= 16\.5: \"robot_1\" weighs .* kg and \"robot_0\" .* kg; must be at most 16 with"
    with pytest.raises(ValidationError, match=message):
        Scenario(engine="rapier", robots=team(16.5))
    assert Scenario(engine="rapier", robots=team(MAX_MASS_RATIO)).robots
    assert Scenario(engine="discs", robots=team(100.0)).robots


def team(ratio: float, robots: int = 8) -> tuple[Robot, ...]:
    """Robots of default size, light and heavy in turn; each accelerates like the default ones."""
    light = ratio**-0.5
    abilities = (("food",), ("food",), ("information",), ("medicine",))
    default = Scenario().robots[0]
    return tuple(
        default.model_copy(
            update={
                "name": f"robot_{index}",
                "kind": f"kind_{index % 4}",
                "abilities": abilities[index % 4],
                "mass_kg": (mass := light * ratio ** (index % 2)),
                "drive_force_n": default.drive_force_n * mass / default.mass_kg,
                "max_speed_mps": (1.0, 1.5)[index % 2],
            }
        )
        for index in range(robots)
    )


def drives(play: str, at: NDArray[Any], step: int, chance: np.random.Generator) -> NDArray[Any]:
    """Where all robots (E, R, 2) go: at random, into one corner, at each other, or after one."""
    robots = np.arange(at.shape[1])
    phase = step // 12
    if play == "random":
        away = chance.standard_normal(at.shape)
    elif play == "corner":
        away = np.array([9.0, 9.0]) - at
    elif play == "head-on":
        away = (1 - 2 * (phase % 2)) * (at[:, robots ^ 1] - at)
    else:
        prey = (np.arange(len(at)) + phase) % len(robots)
        away = at[np.arange(len(at)), prey][:, None] - at
        away[np.arange(len(at)), prey] = at[np.arange(len(at)), prey]  # outward, into a corner
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=2, keepdims=True), 1e-6))


def overlaps(ratio: float, play: str, steps: int) -> NDArray[Any]:
    """The deepest overlap of each world and period, as a share of a radius."""
    scenario = Scenario(
        engine="rapier", actions="continuous", robots=team(ratio), episode_steps=100
    )
    radius, arena = scenario.robots[0].radius_m, scenario.arena_half_width_m
    chance, found = np.random.default_rng(0), []
    with BatchEnv(scenario, WORLDS, seed=1, num_threads=1) as env:
        env.reset()
        for step in range(steps):
            actions = drives(play, env.positions().astype(float), step, chance)
            env.step(actions.astype(np.float32))
            at = env.positions().astype(float)
            assert np.isfinite(at).all()
            pairs = [np.linalg.norm(at[:, i] - at[:, j], axis=1) for i, j in PAIRS]
            between = 2.0 - np.min(pairs, axis=0) / radius
            wall = (np.abs(at).max(axis=(1, 2)) + radius - arena) / radius
            found.append(np.maximum(between, wall))
    return np.concatenate(found)


PAIRS = tuple(combinations(range(8), 2))


@pytest.mark.long
@pytest.mark.parametrize("play", PLAYS)
@pytest.mark.parametrize(
    ("ratio", "usual", "most"),
    [(4.0, 0.01, 0.05), (10.0, 0.02, 0.08), (MAX_MASS_RATIO, 0.02, 0.05)],
)
def test_overlaps_stay_within_what_the_page_says(
    ratio: float, usual: float, most: float, play: str
) -> None:
    found = overlaps(ratio, play, STEPS * LONGER)
    deep, deepest = np.quantile(found, 0.999), found.max()
    print(f"masses {ratio:.0f} : 1, {play}: {deep:.2%} of a radius at p99.9, {deepest:.2%} at most")
    assert deepest > 0.0  # they do touch
    assert deep <= usual
    assert deepest <= most
