"""Teams in frames: a turned world gets the turned actions, to the bit."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.config import Arrival, Communication, Fault, Obstacle, RunConfig, Scenario
from innerattn.config.turning import turning_hindrance
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.learn.types import Learner, RememberingLearner
from innerattn.nn import NUM_ELEMENTS, SquareSymmetry
from innerattn.train.build import build_learner
from innerattn.train.columns import vector_columns

CONTINUOUS_METHODS = ("ppo-inner", "ppo-uniform", "mappo")
METHODS = ("td-inner", "td-uniform", "ppo-inner", "ppo-uniform", "mappo")
FAULTS = (Fault(robot="food_0", kind="heading_bias", value=0.4),)
TEAM = Scenario().robots
PLACED = (TEAM[0], TEAM[1].replace(start_m=(0.5, 0.0)), *TEAM[2:])
TASKS = Scenario().tasks
MIDDLE, LEFT = (-0.75, -0.75, 0.75, 0.75), (-0.9, -0.9, 0.0, 0.9)


def run(method: str, scenario: Scenario, symmetry: str = "canonical") -> RunConfig:
    return RunConfig.model_validate(
        {
            "scenario": scenario,
            "network": {"symmetry": symmetry, "hidden_width": 16, "parameter_sharing": "kind"},
            "train": {"method": method, "threads": 1},
        }
    )


def some_observations(scenario: Scenario) -> NDArray[np.float32]:
    draws = np.random.default_rng(0)
    with closing(BatchEnv(scenario, 200, seed=3, num_threads=1)) as env:
        env.reset()
        for _ in range(7):
            if env.continuous:
                step = env.step(draws.uniform(-1, 1, (200, env.num_robots, 2)).astype(np.float32))
            else:
                step = env.step(draws.integers(0, 5, (200, env.num_robots)))
    return step.obs.copy()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("situation", ["mixed", "double", "single"])
def test_a_turned_world_gets_the_turned_actions(method: str, situation: str) -> None:
    scenario = Scenario.preset(situation).replace(faults=FAULTS, observe_faults=True)
    obs = torch.from_numpy(some_observations(scenario))
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        learner = build_learner(run(method, scenario), env)
        symmetry = SquareSymmetry(vector_columns(env.observation_names()), torch.device("cpu"))
    check_turned(learner, symmetry, obs)


def check_turned(learner: Learner, symmetry: SquareSymmetry, obs: Tensor) -> None:
    """In turned worlds a learner takes the turned actions, and attends to the same teammates."""
    actions = learner.act(obs, greedy=True)
    assert len(actions.unique()) > 1
    weights = learner.attention(obs, actions)
    for number in range(NUM_ELEMENTS):
        element = torch.full(obs.shape[:2], number)
        there = symmetry.turn(obs, element)
        assert torch.equal(learner.act(there, greedy=True), symmetry.turn_actions(actions, element))
        if weights is not None:
            turned = learner.attention(there, symmetry.turn_actions(actions, element))
            assert turned is not None
            assert torch.equal(turned, weights)


@pytest.mark.parametrize("preset", ["mixed", "mixed-sight"])
@pytest.mark.parametrize("pooling", ["attention", "mean", "max", "nearest"])
def test_so_it_does_however_entities_are_pooled(pooling: str, preset: str) -> None:
    scenario = Scenario.preset(preset)
    obs = torch.from_numpy(some_observations(scenario))
    if scenario.has_limited_sight:
        with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
            obs = obs[~looks_alike_mirrored(obs, env.observation_names()).any(dim=1)]
        assert 100 < len(obs) < 200
    config = run("ppo-inner", scenario)
    network = config.network.replace(encoder="entities", pooling=pooling)
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        learner = build_learner(config.replace(network=network), env)
        symmetry = SquareSymmetry(vector_columns(env.observation_names()), torch.device("cpu"))
    check_turned(learner, symmetry, obs)


def looks_alike_mirrored(obs: Tensor, names: list[str]) -> Tensor:
    """Whether a robot rests in a corner and sees nobody, and so looks the same in two frames."""
    seen = [name.endswith((".seen", ".present")) for name in names]
    return (obs[..., 0].abs() == obs[..., 1].abs()) & (obs[..., seen] == 0).all(dim=-1)


@pytest.mark.parametrize("method", ["td-inner", "ppo-inner"])
def test_teammates_settle_the_frame_of_a_robot_that_rests_in_a_corner(method: str) -> None:
    """Where sight is limited it may see them alone."""
    far, arena = (0.2, 0.2, 0.9, 0.9), Scenario().arena_half_width_m
    for corner in ((-1, -1), (-1, 1)):
        scenario = Scenario.preset("mixed-sight")
        x, y = (sign * (arena - 2 * scenario.robots[0].radius_m) for sign in corner)
        starts = ((x, y), *((x * a, y * b) for a, b in ((0.8, 0.7), (0.6, 1.0), (1.0, 0.6))))
        robots = [one.replace(start_m=at) for one, at in zip(scenario.robots, starts, strict=True)]
        placed = scenario.replace(robots=robots, victim_area_m=far)
        with closing(BatchEnv(placed, 20, num_threads=1)) as env:
            obs = torch.from_numpy(env.reset().copy())
            names = env.observation_names()
            learner = build_learner(run(method, scenario), env)
        symmetry = SquareSymmetry(vector_columns(names), torch.device("cpu"))
        assert (obs[:, 0, 0].abs() == obs[:, 0, 1].abs()).all()
        assert not obs[:, 0, [name.endswith(".present") for name in names]].any()
        assert not looks_alike_mirrored(obs, names).any()
        check_turned(learner, symmetry, obs)


LATE = Communication(range_m=1.2, delay_steps=2, loss=0.1)
REMEMBERED = {
    "memory": ("mixed", None, {"memory_width": 8}),
    "messages": ("mixed-sight", None, {"message_width": 8}),
    "largest": ("mixed", None, {"message_width": 8, "message_pooling": "max"}),
    "late messages": ("mixed", LATE, {"message_width": 8, "message_pooling": "nearest"}),
    "both": ("mixed-sight", LATE, {"message_width": 8, "memory_width": 4}),
}


@pytest.mark.parametrize("method", ["ppo-inner", "mappo"])
@pytest.mark.parametrize(("preset", "limits", "network"), REMEMBERED.values(), ids=REMEMBERED)
def test_a_turned_episode_gets_the_turned_actions_of_robots_that_remember(
    method: str, preset: str, limits: Communication | None, network: dict[str, Any]
) -> None:
    """What they remember and say turns with the world, through steps whose frames differ."""
    scenario = Scenario.preset(preset).replace(communication=limits)
    config = run(method, scenario)
    config = config.replace(network=config.network.replace(**network))
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        plain, turned = build_learner(config, env), build_learner(config, env)
        symmetry = SquareSymmetry(vector_columns(env.observation_names()), torch.device("cpu"))
    for number in range(1, NUM_ELEMENTS):
        for learner in (plain, turned):
            assert isinstance(learner, RememberingLearner)
            learner.forget()
        with closing(BatchEnv(scenario, 50, seed=3, num_threads=1)) as env:
            obs = torch.from_numpy(env.reset())
            for _ in range(6):
                element = torch.full(obs.shape[:2], number)
                actions = plain.act(obs, greedy=True)
                there = symmetry.turn(obs, element)
                found = turned.act(there, greedy=True)
                assert torch.equal(found, symmetry.turn_actions(actions, element))
                weights = plain.attention(obs, actions)
                if weights is not None:
                    assert torch.equal(turned.attention(there, found), weights)
                obs = torch.from_numpy(env.step(actions.numpy()).obs)
        known = plain.remembered()
        assert (known is not None) == ("memory_width" in network)
        assert known is None or known.abs().max() > 0


def test_without_frames_it_does_not() -> None:
    scenario = Scenario.preset("mixed")
    obs = torch.from_numpy(some_observations(scenario))
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        learner = build_learner(run("mappo", scenario, "none"), env)
        symmetry = SquareSymmetry(vector_columns(env.observation_names()), torch.device("cpu"))
    element = torch.full(obs.shape[:2], 1)
    there = learner.act(symmetry.turn(obs, element), greedy=True)
    assert not torch.equal(there, symmetry.turn_actions(learner.act(obs, greedy=True), element))


def test_worlds_turn_at_random_in_training_alone() -> None:
    scenario = Scenario.preset("mixed")
    obs = torch.from_numpy(some_observations(scenario))
    config = run("mappo", scenario, "augmented")
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        plain = build_learner(run("mappo", scenario, "none"), env)
        playing = build_learner(config, env)
        training = build_learner(config, env, training=True)
        again = build_learner(config, env, training=True)
    greedy = plain.act(obs, greedy=True)
    assert torch.equal(playing.act(obs, greedy=True), greedy)
    first, second = (training.act(obs, greedy=True) for _ in range(2))
    assert not torch.equal(first, second)
    assert torch.equal(again.act(obs, greedy=True), first)


@pytest.mark.parametrize(
    "obstacle",
    [
        Obstacle(shape="disc", radius_m=0.1, position_m=(0.2, 0.0)),
        Obstacle(shape="box", half_extents_m=(0.1, 0.2)),
    ],
)
def test_obstacles_that_break_the_symmetry_are_refused(obstacle: Obstacle) -> None:
    scenario = Scenario(obstacles=(obstacle,))
    with (
        closing(BatchEnv(scenario, 1, num_threads=1)) as env,
        pytest.raises(ConfigError, match=r"scenario\.obstacles\[0\]: network\.symmetry"),
    ):
        build_learner(run("td-inner", scenario), env)


@pytest.mark.parametrize(
    ("key", "changes"),
    [
        (r"robots\[1\]\.start_m", {"robots": PLACED}),
        ("victim_places_m", {"victim_places_m": ((0.5, 0.5), (-0.5, -0.5))}),
        ("victim_area_m", {"victim_area_m": (-0.5, -0.5, 0.5, 0.4)}),
        ("victim_area_m", {"victim_area_m": (0.0, 0.0, 0.5, 0.5)}),
        (r"tasks\[1\]\.area_m", {"tasks": (TASKS[0], TASKS[1].replace(area_m=LEFT))}),
        (
            "victim_area_m",
            {"victim_area_m": LEFT, "tasks": (TASKS[0].replace(area_m=MIDDLE), TASKS[1])},
        ),
    ],
)
def test_places_that_break_the_symmetry_are_refused(key: str, changes: dict[str, object]) -> None:
    scenario = Scenario().replace(**changes)
    with (
        closing(BatchEnv(scenario, 1, num_threads=1)) as env,
        pytest.raises(ConfigError, match=rf"scenario\.{key}: network\.symmetry"),
    ):
        build_learner(run("td-inner", scenario), env)


@pytest.mark.parametrize(
    "changes",
    [
        {"victim_area_m": MIDDLE},
        {"tasks": (TASKS[0].replace(area_m=MIDDLE), TASKS[1])},
        {"tasks": [one.replace(area_m=MIDDLE) for one in TASKS], "victim_area_m": LEFT},
    ],
)
def test_squares_around_the_centre_are_not(changes: dict[str, object]) -> None:
    scenario = Scenario().replace(**changes)
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        build_learner(run("td-inner", scenario), env)


SQUARE = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
OCTAGON = [(x, y) for a in (-0.5, 0.5) for b in (-0.2, 0.2) for x, y in ((a, b), (b, a))]


def listed(places: list[tuple[float, float]], at_s: float = 1.0) -> Scenario:
    arrivals = [Arrival(at_s=at_s, task="task_1", position_m=place) for place in places]
    return Scenario(situation="listed", max_victims=8, arrivals=arrivals)


@pytest.mark.parametrize(
    ("scenario", "lonely"),
    [
        (listed([(0.5, 0.0)]), 0),
        (listed([(0.5, 0.5), (-0.5, -0.5)]), 0),
        (listed([(0.0, 0.0), *OCTAGON[1:]]), 1),
        (listed([*SQUARE, SQUARE[0]]), 0),
    ],
)
def test_lists_of_arrivals_that_break_the_symmetry_are_refused(
    scenario: Scenario, lonely: int
) -> None:
    with (
        closing(BatchEnv(scenario, 1, num_threads=1)) as env,
        pytest.raises(ConfigError, match=rf"arrivals\[{lonely}\]\.position_m: network\.symmetry"),
    ):
        build_learner(run("td-inner", scenario), env)


def test_places_of_other_times_and_tasks_are_no_images() -> None:
    ones = listed(SQUARE).arrivals
    late, other = ones[3].replace(at_s=2.0), ones[3].replace(task="task_2")
    for last in (late, other):
        scenario = listed(SQUARE).replace(arrivals=(*ones[:3], last))
        assert turning_hindrance(scenario) is not None


@pytest.mark.parametrize("places", [[(0.0, 0.0)], SQUARE, OCTAGON, SQUARE * 2])
def test_lists_whose_places_map_onto_each_other_are_not(places: list[tuple[float, float]]) -> None:
    scenario = listed(places)
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        build_learner(run("td-inner", scenario), env)


def test_obstacles_at_random_places_are_not() -> None:
    scenario = Scenario(obstacles=(Obstacle(shape="disc", radius_m=0.1),))
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        build_learner(run("td-inner", scenario), env)


@pytest.mark.parametrize("method", CONTINUOUS_METHODS)
def test_a_turned_world_gets_the_turned_forces(method: str) -> None:
    scenario = Scenario.preset("mixed").replace(
        actions="continuous", faults=FAULTS, observe_faults=True
    )
    obs = torch.from_numpy(some_observations(scenario))
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        learner = build_learner(run(method, scenario), env)
        symmetry = SquareSymmetry(vector_columns(env.observation_names()), torch.device("cpu"))
    greedy = learner.act(obs, greedy=True)
    assert greedy.shape == (200, 4, 2)
    assert greedy.dtype == torch.float32
    learner.seed_draws(5)
    drawn = learner.act(obs)
    weights = learner.attention(obs, drawn)
    for number in range(NUM_ELEMENTS):
        element = torch.full(obs.shape[:2], number)
        there = symmetry.turn(obs, element)
        assert torch.equal(learner.act(there, greedy=True), symmetry.turn_actions(greedy, element))
        learner.seed_draws(5)
        assert torch.equal(learner.act(there), symmetry.turn_actions(drawn, element))
        if weights is not None:
            turned = learner.attention(there, symmetry.turn_actions(drawn, element))
            assert turned is not None
            assert torch.equal(turned, weights)


def test_a_turned_world_moves_as_turned_forces_say() -> None:
    """The elements mean for forces what they mean in the worlds, not only for the network."""
    scenario = Scenario.preset("mixed").replace(actions="continuous")
    forces = torch.rand(1, 4, 2, generator=torch.Generator().manual_seed(1)) * 2 - 1
    with closing(BatchEnv(scenario, 1, seed=2, num_threads=1)) as env:
        env.reset()
        symmetry = SquareSymmetry(vector_columns(env.observation_names()), torch.device("cpu"))
        start = env.snapshot()
        for number in range(NUM_ELEMENTS):
            element = torch.full((1, 4), number)
            env.restore(start)
            env.step(symmetry.turn_actions(forces, element).numpy())
            velocity = env.velocities()[0].copy()
            env.restore(start)
            env.step(forces.numpy())
            expected = symmetry.turn_actions(torch.tensor(env.velocities()), element)[0]
            np.testing.assert_allclose(velocity, expected, atol=1e-6)
