"""The largest and smallest worlds and batches that a scenario allows keep every promise."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from innerattn.config import Robot, Scenario, Task
from innerattn.envs import BatchEnv

STEPS = 12
OVERLAP_M = 2e-3  # what `docs/contacts.md` allows rapier


def team(count: int) -> tuple[Robot, ...]:
    default = Scenario().robots
    return tuple(
        default[i % 4].replace(name=f"robot_{i}", radius_m=(0.03, 0.05, 0.04)[i % 3])
        for i in range(count)
    )


def tasks(count: int) -> tuple[Task, ...]:
    """The default tasks, or, for a team too small for them, tasks that one robot does."""
    default = Scenario().tasks
    return default if count >= 4 else tuple(one.replace(needs=("food",)) for one in default)


def least_gap(positions: NDArray[np.float32], radii: NDArray[np.float64]) -> float:
    """The least distance between the rims of two robots of a world [m]."""
    gaps = np.linalg.norm(positions[:, :, None] - positions[:, None], axis=-1)
    gaps -= radii[:, None] + radii
    index = np.arange(len(radii))
    gaps[:, index, index] = np.inf
    return float(gaps.min())


@settings(max_examples=40)
@given(
    robots=st.integers(1, 64),
    victims=st.integers(1, 32),
    engine=st.sampled_from(["rapier", "discs"]),
    situation=st.sampled_from(["single", "double", "mixed"]),
    envs=st.integers(1, 5),
    seed=st.integers(0, 2**64 - 1),
)
def test_any_team_and_any_number_of_victims(
    robots: int, victims: int, engine: str, situation: str, envs: int, seed: int
) -> None:
    scenario = Scenario.preset("mixed").replace(
        robots=team(robots),
        tasks=tasks(robots),
        max_victims=victims,
        engine=engine,
        situation=situation,
        arena_half_width_m=3.0,
        episode_steps=5,
    )
    radii = np.array([robot.radius_m for robot in scenario.robots])
    rng = np.random.default_rng(seed)
    with BatchEnv(scenario, envs, seed, 1) as env:
        obs = env.reset()
        for _ in range(STEPS):
            assert obs.shape == (envs, robots, env.obs_width)
            assert np.isfinite(obs).all()
            step = env.step(rng.integers(0, env.num_actions, (envs, robots)))
            obs = step.obs
            assert step.reward.shape == (envs, robots)
            assert np.isfinite(step.reward).all()
            places = env.positions()
            assert (np.abs(places) <= 3.0 - radii[:, None] + OVERLAP_M).all()
            if robots > 1:
                assert least_gap(places, radii) > -OVERLAP_M
        slots = {"single": 1, "double": 2, "mixed": victims}[situation]
        assert env.victims().shape[1] == slots


@pytest.mark.parametrize("envs", [1, 2, 2**16])
def test_batches_of_any_size_do_the_same(envs: int) -> None:
    scenario = Scenario.preset("single").replace(robots=team(1), tasks=tasks(1), engine="discs")
    with BatchEnv(scenario, envs, 3, 2) as many, BatchEnv(scenario, 1, 3, 1) as one:
        many.reset()
        one.reset()
        for step in range(4):
            made = many.step(np.full((envs, 1), step))
            alone = one.step(np.full((1, 1), step))
            assert made.obs[:1].tobytes() == alone.obs.tobytes()
            assert np.isfinite(made.obs).all()
            assert (np.abs(many.positions()) <= 1.0).all()


def test_random_states_of_the_process_are_left_alone() -> None:
    random.seed(1)
    np.random.seed(1)
    before = random.getstate(), np.random.get_state()[1].tobytes()
    with BatchEnv("mixed-faults", 8, 5, 2) as env:
        env.reset()
        for _ in range(30):
            env.step(np.zeros((8, env.num_robots), np.int64))
        env.restore(env.snapshot())
    after = random.getstate(), np.random.get_state()[1].tobytes()
    assert after == before


def first_places(seed: int, envs: int) -> NDArray[np.float64]:
    """(E, 2): where the first victim of each world is, as shares of where it may be."""
    scenario = Scenario.preset("single")
    with BatchEnv(scenario, envs, seed, 2) as env:
        env.reset()
        victims = env.victims()[:, 0]
    places = np.stack([victims["x"], victims["y"]], -1).astype(np.float64)
    half = scenario.arena_half_width_m - scenario.wall_clearance_m
    return np.asarray((places / half + 1.0) / 2.0)


ENVS = 20_000


@pytest.mark.parametrize(
    ("name", "first", "second"),
    [
        ("neighbouring worlds", (0, slice(None, -1)), (0, slice(1, None))),
        ("neighbouring seeds", (0, slice(None)), (1, slice(None))),
        ("seeds that differ in a high bit", (7, slice(None)), (7 + 2**63, slice(None))),
        (
            "a seed's world and the next seed's one before",
            (4, slice(1, None)),
            (5, slice(None, -1)),
        ),
    ],
)
def test_random_streams_are_independent(
    name: str, first: tuple[int, slice], second: tuple[int, slice]
) -> None:
    """Correlation and a test of independence on a grid, of each pair of coordinates.

    The numbers are always the same, so the test cannot fail by chance from one day to the next.
    """
    one, two = (first_places(seed, ENVS)[part] for seed, part in (first, second))
    least = 1e-4 / 4  # over the four pairs of coordinates
    for a in range(2):
        for b in range(2):
            assert stats.pearsonr(one[:, a], two[:, b]).pvalue > least, name
            table = np.histogram2d(one[:, a], two[:, b], bins=8, range=[(0, 1), (0, 1)])[0]
            assert stats.chi2_contingency(table).pvalue > least, name


def test_the_statistic_finds_streams_that_go_together() -> None:
    places = first_places(0, ENVS)
    mixed = places + 0.05 * first_places(1, ENVS)
    assert stats.pearsonr(places[:, 0], mixed[:, 0]).pvalue < 1e-12
