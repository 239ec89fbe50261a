"""Plays a schedule in a world: what becomes of it where robots have bodies and control periods."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config.instances import Instance
from innerattn.config.instances.bodies import DT_S, REACH_M, Engine, world_of
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import PolicyInput, WorldState
from innerattn.policies.scripted.planner import Schedule
from innerattn.policies.scripted.steering import Steering
from innerattn.records import FIELDS, Record


def most_time(schedule: Schedule) -> float:
    """How long a schedule is played at most, in the instance's units."""
    return 3.0 * schedule.makespan + 10.0


class Following:
    """A policy in which each robot goes to its tasks in order, stays until they are done, and home.

    Attributes:
        scenario: of the world, see `world_of`.
    """

    name = "schedule"
    needs_true_state = True

    def __init__(self, instance: Instance, schedule: Schedule, engine: Engine) -> None:
        """Make the world.

        Args:
            instance: robots and tasks.
            schedule: of the instance.
            engine: "none" for points that pass through each other, else the contacts.

        Raises:
            ConfigError: the instance has no world, see `world_of`.
        """
        self.scenario = world_of(instance, engine, most_time(schedule))
        self._steering = Steering(self.scenario)
        self._places = np.array([one.position_m for one in self.scenario.arrivals])
        self._starts = np.array([robot.start_m for robot in self.scenario.robots])
        self._tasks = schedule.tasks

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """Actions (E, R, 2); see `Policy.act`."""
        state = view.known_state
        is_open = state.victims["present"]
        targets = np.stack([self._targets(row) for row in is_open])
        return self._steering.actions(state.positions, state.velocities, targets)

    def reset(self, seed: int) -> None:
        """See `Policy.reset`; nothing is remembered or drawn."""

    def is_back(self, state: WorldState) -> NDArray[np.bool_]:
        """In which worlds (E,) all tasks are done and all robots within reach of their starts."""
        away = np.linalg.norm(state.positions - self._starts, axis=-1)
        is_home: NDArray[np.bool_] = (away <= REACH_M).all(axis=1)
        return is_home & ~state.victims["present"].any(axis=1)

    def _targets(self, is_open: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Where each robot of one world goes (R, 2)."""
        following = zip(self._tasks, self._starts, strict=True)
        return np.array(
            [
                next((self._places[task] for task in tasks if is_open[task]), home)
                for tasks, home in following
            ]
        )


def play_schedule(instance: Instance, schedule: Schedule, engine: Engine) -> float | None:
    """When the last robot is back, if each goes to its tasks in order.

    Args:
        instance: robots and tasks.
        schedule: of the instance.
        engine: as of `Following`.

    Returns:
        The makespan in the instance's units; None if robots are not back after `most_time`.

    Raises:
        ConfigError: the instance has no world, see `world_of`.
    """
    policy = Following(instance, schedule, engine)
    with closing(BatchEnv(policy.scenario, 1, num_threads=1)) as env:
        obs, state = env.reset(), WorldState.of(env)
        for step in range(1, policy.scenario.episode_steps):
            obs = env.step(policy.act(PolicyInput(obs, state))).obs
            state = WorldState.of(env)
            if policy.is_back(state)[0]:
                return round(step * DT_S, 9)
    return None


def record_schedule(instance: Instance, schedule: Schedule, engine: Engine) -> Record:
    """One episode in which robots carry out a schedule, until the last one is back.

    Raises:
        ConfigError: the instance has no world, see `world_of`.
    """
    policy = Following(instance, schedule, engine)
    makespan = play_schedule(instance, schedule, engine)
    steps = policy.scenario.episode_steps if makespan is None else round(makespan / DT_S)
    scenario = policy.scenario.replace(episode_steps=steps)
    return run_episodes(policy, scenario, 1, 0, record=FIELDS)
