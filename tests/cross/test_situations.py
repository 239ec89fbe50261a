"""What is drawn at random, by chi-square tests with fixed seeds: tasks, waves and places."""

import numpy as np
import pytest
from scipy import stats

from innerattn.config import Obstacle, Scenario, Task
from innerattn.envs import BatchEnv
from innerattn.policies import PolicyInput, WorldState
from innerattn.policies.scripted.dispatch import HungarianPolicy

SITUATIONS = ("single", "double", "mixed")
LEAST_P = 1e-3
WORLDS = 4000
THREE_TASKS = (*Scenario().tasks, Task(name="task_3", needs=("medicine", "information")))


def first_of(scenario: Scenario, worlds: int = WORLDS, seed: int = 3) -> BatchEnv:
    env = BatchEnv(scenario, worlds, seed=seed, num_threads=1)
    env.reset()
    return env


def assert_uniform(counts: np.ndarray) -> None:
    assert counts.min() >= 20, counts
    assert stats.chisquare(counts).pvalue > LEAST_P, counts


def assert_square_uniform(places: np.ndarray, half: float, cells: int = 8) -> None:
    """Cells of equal area hold equally many of the places (n, 2), and none lies outside."""
    assert abs(places).max() <= half
    edges = np.linspace(-half, half, cells + 1)
    assert_uniform(np.histogram2d(places[:, 0], places[:, 1], [edges, edges])[0].ravel())


def place_of(victims: np.ndarray) -> np.ndarray:
    return np.stack([victims["x"], victims["y"]], -1)


def test_single_draws_every_task_equally() -> None:
    victims = first_of(Scenario(situation="single", tasks=THREE_TASKS)).victims()
    assert victims.shape == (WORLDS, 1)
    assert victims["present"].all()
    assert_uniform(np.bincount(victims["task"].ravel(), minlength=3))


@pytest.mark.parametrize("most", [1, 2, 5])
def test_mixed_waves_are_of_any_size_and_task(most: int) -> None:
    scenario = Scenario(situation="mixed", tasks=THREE_TASKS, max_victims=most)
    victims = first_of(scenario).victims()
    sizes = victims["present"].sum(1)
    assert victims.shape == (WORLDS, most)
    assert (sizes.min(), sizes.max()) == (1, most)
    if most > 1:
        assert_uniform(np.bincount(sizes - 1, minlength=most))
    for slot in range(most):  # whatever the size of the wave or the slot in it
        tasks = victims["task"][:, slot][victims["present"][:, slot]]
        assert_uniform(np.bincount(tasks, minlength=3))
    if most > 1:
        pairs = victims["task"][sizes >= 2, :2]
        assert_uniform(np.bincount(pairs @ [3, 1], minlength=9))


def test_double_has_one_of_each() -> None:
    victims = first_of(Scenario(situation="double", tasks=THREE_TASKS)).victims()
    assert victims["present"].all()
    assert (np.sort(victims["task"], axis=1) == [0, 1, 2]).all()


@pytest.mark.parametrize("wall_m", [0.0, 0.25])
def test_victims_are_uniform_on_the_allowed_square(wall_m: float) -> None:
    scenario = Scenario(situation="double", spawn_clearance_m=0.0, wall_clearance_m=wall_m)
    places = place_of(first_of(scenario).victims())
    for slot in range(2):
        assert_square_uniform(places[:, slot], 1.0 - wall_m)
    first = (places[:, 0] > 0) @ [2, 1]
    second = (places[:, 1] > 0) @ [2, 1]
    assert_uniform(np.bincount(first * 4 + second, minlength=16))  # one says nothing of the other


def test_robots_start_at_rest_inside_without_overlap() -> None:
    scenario = Scenario()
    env = first_of(scenario, 8000)
    places, radius = env.positions(), np.array([robot.radius_m for robot in scenario.robots])
    assert not env.velocities().any()
    assert (abs(places).max((0, 2)) <= 1.0 - radius).all()
    gap = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1) - radius[:, None] - radius
    assert gap[:, ~np.eye(4, dtype=bool)].min() >= 0.0
    assert_square_uniform(places[:, 0], 0.951)
    # Keeping apart thins the corners of a later robot's square by a per cent at most.
    for robot in range(1, 4):
        edges = np.linspace(-0.951, 0.951, 5)
        counts = np.histogram2d(*places[:, robot].T, [edges, edges])[0]
        assert counts.sum() == 8000
        assert abs(counts / 500 - 1).max() < 0.2


def driven(scenario: Scenario, worlds: int, steps: int):
    """Yields env, result, victims before and after each step of a team that rescues."""
    policy = HungarianPolicy(scenario)
    env = BatchEnv(scenario, worlds, seed=11, num_threads=1, autoreset="disabled")
    obs = env.reset()
    for _ in range(steps):
        before = env.victims()
        result = env.step(policy.act(PolicyInput(obs, WorldState.of(env))))
        yield env, result, before, env.victims()
        obs = result.obs


@pytest.mark.parametrize("situation", ["single", "double"])
def test_a_rescued_victim_is_replaced_at_once(situation: str) -> None:
    scenario = Scenario(situation=situation, episode_steps=150, spawn_clearance_m=0.0)
    new_tasks, new_places = [], []
    for env, result, before, after in driven(scenario, 300, 100):
        assert after["present"].all()
        gone = np.zeros(before.shape, bool)
        gone[result.rescues["env"], result.rescues["slot"]] = True
        assert ((before["id"] != after["id"]) == gone).all()
        assert (before[~gone] == after[~gone]).all()
        assert (after["appeared_step"][gone] == env.step_counts()[np.nonzero(gone)[0]]).all()
        assert (after["id"][gone] > before["id"].max(1)[np.nonzero(gone)[0]]).all()
        if situation == "double":
            assert (before["task"] == after["task"]).all()
        new_tasks.append(after["task"][gone])
        new_places.append(place_of(after)[gone])
    places = np.concatenate(new_places)
    assert len(places) >= 2000
    assert_square_uniform(places, 0.9, cells=6)
    if situation == "single":
        assert_uniform(np.bincount(np.concatenate(new_tasks), minlength=2))


@pytest.mark.long
def test_a_new_wave_waits_for_the_last_of_the_old() -> None:
    scenario = Scenario(situation="mixed", max_victims=3, episode_steps=150)
    sizes, tasks, partly = [], [], 0
    for env, result, before, after in driven(scenario, 300, 120):
        gone = np.zeros(before.shape, bool)
        gone[result.rescues["env"], result.rescues["slot"]] = True
        left = before["present"] & ~gone
        fresh = ~left.any(1)
        assert (after["present"][~fresh] == left[~fresh]).all()
        assert (after[left] == before[left]).all()
        partly += int((gone.any(1) & ~fresh).sum())
        shown = after["present"][fresh]
        assert (after["appeared_step"][fresh][shown] == env.step_counts().max()).all()
        sizes.append(shown.sum(1))
        tasks.append(after["task"][fresh][shown])
    sizes = np.concatenate(sizes)
    assert len(sizes) >= 1000
    assert partly >= 500
    assert_uniform(np.bincount(sizes - 1, minlength=3))
    assert_uniform(np.bincount(np.concatenate(tasks), minlength=2))


def test_clearances_are_kept() -> None:
    obstacles = (
        Obstacle(shape="disc", radius_m=0.2, position_m=(0.3, 0.3)),
        Obstacle(shape="box", half_extents_m=(0.2, 0.1), position_m=(-0.4, -0.2)),
        Obstacle(shape="disc", radius_m=0.1),
    )
    scenario = Scenario(
        situation="double",
        spawn_clearance_m=0.3,
        wall_clearance_m=0.15,
        obstacles=obstacles,
        episode_steps=150,
    )
    checked, nearest = 0, np.inf
    for env, _, before, after in driven(scenario, 200, 40):
        new = after["id"] != before["id"]
        world = np.nonzero(new)[0]
        at = place_of(after)[new]
        if not len(at):
            continue
        robots = np.linalg.norm(env.positions()[world] - at[:, None], axis=-1)
        centres = env.obstacles()[world]
        discs = np.linalg.norm(centres[:, [0, 2]] - at[:, None], axis=-1) - [0.2, 0.1]
        box = np.linalg.norm(np.maximum(abs(at - centres[:, 1]) - [0.2, 0.1], 0.0), axis=-1)
        assert robots.min() >= 0.3 - 1e-6
        assert abs(at).max() <= 0.85 + 1e-6
        assert min(discs.min(), box.min()) >= 0.15 - 1e-6
        checked, nearest = checked + len(at), min(nearest, robots.min())
    assert checked >= 300
    assert nearest < 0.33  # the clearance binds: it is not kept by chance


def test_robots_start_where_the_scenario_says() -> None:
    team = Scenario().robots
    robots = (team[0], team[1].replace(start_m=(0.5, -0.25)), *team[2:])
    env = first_of(Scenario(robots=robots))
    first = env.positions()
    env.reset()
    second = env.positions()
    assert (first[:, 1] == [0.5, -0.25]).all()
    assert (second[:, 1] == [0.5, -0.25]).all()
    others = [0, 2, 3]
    assert (first[:, others] != second[:, others]).any((1, 2)).all()
    apart = np.linalg.norm(first[:, others] - first[:, [1]], axis=-1)
    assert apart.min() >= 0.1


@pytest.mark.parametrize("situation", SITUATIONS)
def test_victims_appear_in_their_area_alone(situation: str) -> None:
    area = (-0.5, 0.125, 0.25, 0.875)
    scenario = Scenario(situation=situation, victim_area_m=area, episode_steps=150)
    places = []
    for _, _, before, after in driven(scenario, 200, 60):
        places.append(place_of(after)[after["present"] & (after["id"] != before["id"])])
    found = np.concatenate(places)
    assert len(found) >= 300
    assert (found >= area[:2]).all()
    assert (found <= area[2:]).all()
    assert np.ptp(found, axis=0) == pytest.approx([0.75, 0.75], abs=0.05)


@pytest.mark.parametrize("situation", SITUATIONS)
def test_victims_of_a_task_fill_its_area_alone(situation: str) -> None:
    areas = np.array([(-0.75, -0.5, -0.25, 0.875), (0.0, -0.875, 0.875, 0.0)])
    first, second = Scenario().tasks
    tasks = (first.replace(area_m=tuple(areas[0])), second)
    scenario = Scenario(
        situation=situation, tasks=tasks, victim_area_m=tuple(areas[1]), episode_steps=150
    ).replace(spawn_clearance_m=0.0)
    found, of_task = [], []
    for _, _, before, after in driven(scenario, 200, 60):
        new = after["present"] & (after["id"] != before["id"])
        found.append(place_of(after)[new])
        of_task.append(after["task"][new])
    places, numbers = np.concatenate(found), np.concatenate(of_task)
    for task, (low, high) in enumerate(areas.reshape(2, 2, 2)):
        own = (places[numbers == task] - low) / (high - low) * 2.0 - 1.0
        assert len(own) >= 300
        assert_square_uniform(own, 1.0, cells=3)


@pytest.mark.parametrize("situation", SITUATIONS)
def test_listed_places_are_those_inside_the_area(situation: str) -> None:
    listed = np.array([(0.5, 0.5), (-0.5, 0.5), (0.0, -0.75), (0.875, 0.0), (-0.25, 0.25)])
    first, second = Scenario().tasks
    scenario = Scenario(
        situation=situation,
        tasks=(first.replace(area_m=(-0.5, 0.0, 0.25, 0.5)), second),
        victim_places_m=tuple(map(tuple, listed)),
        episode_steps=150,
        rescue_radius_m=0.4,
    ).replace(spawn_clearance_m=0.0)
    counts = np.zeros((2, len(listed)), int)
    for _, _, before, after in driven(scenario, 200, 60):
        same = (place_of(after)[:, :, None] == listed).all(-1)  # (E, V, places)
        assert same.sum(1).max() <= 1
        new = after["present"] & (after["id"] != before["id"])
        for task in range(2):
            counts[task] += (same & (new & (after["task"] == task))[..., None]).sum((0, 1))
    assert (counts[0] > 0).tolist() == [False, True, False, False, True]
    assert counts[counts > 0].min() >= 50


@pytest.mark.parametrize("situation", SITUATIONS)
def test_victims_appear_at_listed_places_alone_and_never_two_at_one(situation: str) -> None:
    listed = ((0.5, 0.5), (-0.5, 0.5), (0.0, -0.75), (0.875, 0.0))
    scenario = Scenario(situation=situation, victim_places_m=listed, episode_steps=150)
    counts = np.zeros(len(listed), int)
    for _, _, before, after in driven(scenario, 200, 60):
        same = (place_of(after)[:, :, None] == np.array(listed)).all(-1)  # (E, V, places)
        assert (same.any(-1) == after["present"]).all()
        assert same.sum(1).max() <= 1
        new = after["present"] & (after["id"] != before["id"])
        counts += (same & new[..., None]).sum((0, 1))
    assert counts.min() >= 50


def test_obstacles_without_a_place_move_each_episode() -> None:
    fixed = Obstacle(shape="disc", radius_m=0.1, position_m=(0.25, -0.5))
    scenario = Scenario(obstacles=(fixed, Obstacle(shape="disc", radius_m=0.1)))
    env = first_of(scenario)
    first = env.obstacles()
    env.reset()
    second = env.obstacles()
    assert (first[:, 0] == [0.25, -0.5]).all()
    assert (second[:, 0] == [0.25, -0.5]).all()
    assert (first[:, 1] != second[:, 1]).any(1).all()
    assert abs(first[:, 1]).max() <= 0.9
    assert (np.linalg.norm(first[:, 0] - first[:, 1], axis=-1) >= 0.2).all()
