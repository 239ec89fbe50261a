"""Plays a schedule in a world: what becomes of it where robots have bodies and control periods."""

from __future__ import annotations

from contextlib import closing

import numpy as np

from innerattn.config.instances import Instance
from innerattn.config.instances.bodies import DT_S, REACH_M, Engine, world_of
from innerattn.envs import BatchEnv
from innerattn.policies.scripted.planner import Schedule
from innerattn.policies.scripted.steering import Steering


def most_time(schedule: Schedule) -> float:
    """How long a schedule is played at most, in the instance's units."""
    return 3.0 * schedule.makespan + 10.0


def play_schedule(instance: Instance, schedule: Schedule, engine: Engine) -> float | None:
    """When the last robot is back, if each goes to its tasks in order.

    A robot drives straight to its next task, stays there until it is done, and drives home in the
    end. It is home when it is within reach of its start.

    Args:
        instance: robots and tasks.
        schedule: of the instance.
        engine: "none" for points that pass through each other, else the contacts.

    Returns:
        The makespan in the instance's units; None if robots are not back after `most_time`.

    Raises:
        ConfigError: the instance has no world, see `world_of`.
    """
    scenario = world_of(instance, engine, most_time(schedule))
    steering = Steering(scenario)
    places = np.array([one.position_m for one in scenario.arrivals])
    starts = np.array([robot.start_m for robot in scenario.robots])
    to_do = [list(tasks) for tasks in schedule.tasks]
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        env.reset()
        for step in range(1, scenario.episode_steps):
            targets = np.array(
                [
                    places[tasks[0]] if tasks else home
                    for tasks, home in zip(to_do, starts, strict=True)
                ]
            )
            actions = steering.actions(env.positions(), env.velocities(), targets[None])
            done = set(env.step(actions).rescues["task"].tolist())
            to_do = [[task for task in tasks if task not in done] for tasks in to_do]
            if not any(to_do):
                away = np.linalg.norm(env.positions()[0] - starts, axis=-1)
                if (away <= REACH_M).all():
                    return round(step * DT_S, 9)
    return None
