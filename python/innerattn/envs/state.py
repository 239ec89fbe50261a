"""The state of worlds as one row each, for critics that see everything."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from innerattn.config.scenario import Scenario
from innerattn.envs.aligned import aligned_empty


def state_names(scenario: Scenario) -> list[str]:
    """Names of the S columns of `world_states`; units are m, m/s and rad/s, shares have none."""
    robots = [
        f"{robot.name}.{quantity}"
        for robot in scenario.robots
        for quantity in (
            *("position.x", "position.y", "velocity.x", "velocity.y"),
            *(("heading.x", "heading.y", "turn_rate") * scenario.has_wheels),
            *["charge"] * scenario.has_batteries,
            *["load"] * scenario.has_loads,
        )
    ]
    columns = [*(f"task.{task.name}" for task in scenario.tasks), "position.x", "position.y"]
    columns += ["served"] * scenario.has_services + ["time_left"] * scenario.has_deadlines
    columns += ["blocked"] * scenario.has_order
    victims = [
        f"victim_{slot}.{column}" for slot in range(scenario.num_victims) for column in columns
    ]
    obstacles = [
        f"obstacle_{index}.position.{axis}"
        for index in range(len(scenario.obstacles))
        for axis in ("x", "y")
    ]
    return robots + victims + obstacles


def world_states(
    positions: NDArray[np.float32],
    velocities: NDArray[np.float32],
    victims: NDArray[np.void],
    obstacles: NDArray[np.float32],
    step_counts: NDArray[np.int64],
    scenario: Scenario,
    charge: NDArray[np.float32],
    load: NDArray[np.float32],
    headings: NDArray[np.float32],
    turn_rates: NDArray[np.float32],
) -> NDArray[np.float32]:
    """The states of E worlds.

    Args:
        positions: (E, R, 2) robots' centres [m].
        velocities: (E, R, 2) robots' velocities [m/s].
        victims: (E, V) structured, the fields of `BatchEnv.victims`.
        obstacles: (E, O, 2) obstacles' centres [m].
        step_counts: (E,) steps done in the episodes.
        scenario: the worlds' description.
        charge: (E, R) charges of the robots, shares.
        load: (E, R) loads of the robots, shares.
        headings: (E, R) angles of the robots [rad].
        turn_rates: (E, R) [rad/s].

    Returns:
        (E, S) float32, columns `state_names`.
    """
    present = victims["present"]
    is_task = victims["task"][..., None] == np.arange(len(scenario.tasks))
    places = np.stack([victims["x"], victims["y"]], axis=-1) * present[..., None]
    times = []
    if scenario.has_services:
        times.append((victims["served"] * present)[..., None])
    if scenario.has_deadlines:
        left = shares_left(scenario, victims, step_counts)
        times.append((left * present)[..., None])
    if scenario.has_order:
        times.append(victims["blocked"][..., None])
    stores = [charge[..., None]] * scenario.has_batteries + [load[..., None]] * scenario.has_loads
    pointing = []
    if scenario.has_wheels:
        wheels = np.array([robot.has_wheels for robot in scenario.robots], np.float32)
        ahead = np.stack([np.cos(headings), np.sin(headings)], -1) * wheels[:, None]
        pointing = [ahead, turn_rates[..., None]]
    parts = [
        np.concatenate([positions, velocities, *pointing, *stores], axis=2),
        np.concatenate([is_task & present[..., None], places, *times], axis=2),
        obstacles,
    ]
    rows = [part.reshape(len(part), math.prod(part.shape[1:])) for part in parts]
    states = aligned_empty((len(positions), sum(row.shape[1] for row in rows)), np.float32)
    return np.concatenate(rows, axis=1, out=states)


def shares_left(
    scenario: Scenario, victims: NDArray[np.void], step_counts: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Time that victims have left, as shares of the longest deadline, (E, V) float32.

    It is 1 for a victim that is never lost.

    Args:
        scenario: one that has deadlines.
        victims: (E, V) structured, the fields of `BatchEnv.victims`.
        step_counts: (E,) steps done in the episodes.
    """
    longest = math.ceil(scenario.longest_deadline_s / scenario.dt_s * (1.0 - 1e-12))
    left = np.clip((victims["deadline_step"] - step_counts[:, None]) / longest, 0.0, 1.0)
    return np.where(victims["deadline_step"] < 0, 1.0, left).astype(np.float32)
