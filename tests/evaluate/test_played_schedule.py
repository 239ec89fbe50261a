"""Schedules that robots with bodies play, beside what is simulated of points."""

from typing import Any

import numpy as np
import pytest

from innerattn.config.instances import Instance, read_instances
from innerattn.config.instances.bodies import DT_S, REACH_M, world_of
from innerattn.errors import ConfigError
from innerattn.evaluate.played_schedule import most_time, play_schedule, record_schedule
from innerattn.policies.scripted.planner import Schedule, plan, schedule_by, simulate

ENGINES: list[Any] = ["none", "discs", "rapier"]


def instance(**changes: object) -> Instance:
    """Two robots at one depot, and a task for both, four units away."""
    values: dict[str, Any] = {
        "name": "pair",
        "speed": 1.0,
        "robots": [{"depot": [0.0, 0.0], "skills": [0]}] * 2,
        "tasks": [{"position": [4.0, 0.0], "skills": [0, 0], "duration": 2.0}],
    }
    return Instance.model_validate(values | changes)


def simulated(one: Instance, *tasks: list[int]) -> Schedule:
    return simulate(one, tasks)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_way_and_a_task_take_as_long_as_they_must(engine: Any) -> None:
    schedule = simulated(instance(), [0], [0])
    assert schedule.makespan == 10.0
    played = play_schedule(instance(), schedule, engine)
    assert played is not None
    # Two units are a metre. Each way ends within reach, and the step of arrival counts as work.
    saved = 2 * REACH_M / (2.0 / 4.0) + DT_S
    assert 10.0 - saved - 1e-6 <= played <= 10.0 + 6 * DT_S


@pytest.mark.parametrize("engine", ENGINES)
def test_published_instances_take_about_as_long_with_bodies(engine: Any) -> None:
    for one in read_instances("ral")[:3]:
        schedule = schedule_by("greedy", one, 0.0, 0)
        played = play_schedule(one, schedule, engine)
        assert played == pytest.approx(schedule.makespan, rel=0.03)


def test_points_take_as_long_as_simulated_but_for_steps_and_reach() -> None:
    """A drive saves the reach and loses less than a step; work saves or loses one at most."""
    rng = np.random.default_rng(5)
    for number in range(8):
        count = int(rng.integers(1, 5))
        places = rng.uniform(0.0, 3.0, (count + 6, 2)).round(3).tolist()
        robots = [{"depot": places[index], "skills": [0, 1]} for index in range(count)]
        tasks = [
            {
                "position": place,
                "skills": [0, 1][: int(rng.integers(1, min(count, 2) + 1))],
                "duration": float(rng.uniform(0.0, 3.0)),
            }
            for place in places[count:]
        ]
        one = instance(name=f"random_{number}", robots=robots, tasks=tasks, speed=0.5)
        schedule = plan(one, None, 200, number)
        played = play_schedule(one, schedule, "none")
        assert played is not None
        drives = 7  # six tasks, and the way home
        side = np.ptp(np.array(places), axis=0).max()
        reach = REACH_M * side / 2.0 / 0.5
        low = schedule.makespan - drives * (reach + DT_S)
        high = schedule.makespan + 2 * drives * DT_S
        assert low - 1e-6 <= played <= high + 1e-6


def test_what_has_no_world_is_refused() -> None:
    tasks = [{"position": [0.1 * n, 1.0], "skills": [0], "duration": 1.0} for n in range(33)]
    many = instance(tasks=tasks)
    with pytest.raises(ConfigError, match="pair: 33 tasks: a world has at most 32"):
        world_of(many, "rapier", 10.0)
    fast = instance(speed=1e6)
    with pytest.raises(ConfigError, match=r"pair: cannot be played in a world: .*max_speed_mps"):
        world_of(fast, "rapier", 10.0)


def test_robots_that_are_never_back_are_given_up() -> None:
    """A schedule that no simulation gave: the second robot is never sent."""
    one = instance()
    wrong = Schedule(((0,), ()), (4.0,), (10.0, 0.0), 10.0)
    assert most_time(wrong) == 40.0
    assert play_schedule(one, wrong, "discs") is None


def test_robots_of_one_depot_start_beside_each_other() -> None:
    many = instance(robots=[{"depot": [0.0, 0.0], "skills": [0]}] * 20)
    starts = np.array([robot.start_m for robot in world_of(many, "rapier", 10.0).robots])
    apart = np.linalg.norm(starts[:, None] - starts, axis=-1) + np.eye(20)
    assert apart.min() >= 0.02
    same = np.array([robot.start_m for robot in world_of(many, "none", 10.0).robots])
    assert (same == same[0]).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_record_ends_when_the_last_robot_is_back(engine: Any) -> None:
    one = read_instances("ral")[4]
    schedule = schedule_by("greedy", one, 0.0, 0)
    record = record_schedule(one, schedule, engine)
    played = play_schedule(one, schedule, engine)
    assert played is not None
    assert record.num_episodes == 1
    assert record.scenario.episode_steps * DT_S == pytest.approx(played)
    assert sorted(record.rescues["task"].tolist()) == list(range(20))
    starts = [robot.start_m for robot in record.scenario.robots]
    away = np.linalg.norm(record.steps["positions"][0, -1] - starts, axis=-1)
    assert away.max() <= REACH_M + 0.05
