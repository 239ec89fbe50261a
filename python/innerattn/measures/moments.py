"""The moments of an episode that are worth a look: handoffs, blocked robots, faults.

They are read off a record; nothing is played.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn import _core
from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.batch import FAULT_KINDS
from innerattn.measures.sharing.handoff import HANDOFF, handoffs
from innerattn.policies.scripted.wheels import Wheels
from innerattn.records.record import Record

FAULT_SPELL = np.dtype(
    [
        *((name, np.int64) for name in ("episode", "robot", "kind", "start", "end")),
        ("value", np.float32),
    ]
)
"""A fault in effect. episode: its number; robot: who has it; kind: index in `FAULT_KINDS`; start,
end: first step with it and first step without it; value: how bad it is, in the kind's unit."""

_HEALTHY = {name: healthy for name, _, _, _, healthy, _ in _core.FAULT_KINDS}
_DIRECTIONS = np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], np.float64)
_TOUCH_M = 2e-3
_LEAST_WAY_M = 5e-3
_FREE_SHARE = 0.5


def handoffs_of_all_robots(record: Record) -> NDArray[np.void]:
    """The handoffs of every robot between any two tasks with two needs each.

    Returns:
        (N,) `HANDOFF`, in the order of episodes and of the second rescue.
    """
    tasks = [task.name for task in record.scenario.tasks if len(task.roles) == 2]
    found = [
        handoffs(record, robot, first, later)
        for robot in record.robot_names
        for first in tasks
        for later in tasks
        if first != later
    ]
    rows = np.concatenate([np.zeros(0, HANDOFF), *found])
    return rows[np.lexsort((rows["robot"], rows["second"], rows["episode"]))]


def fault_spells(record: Record) -> NDArray[np.void]:
    """Which robot had which fault, from when to when.

    Returns:
        (N,) `FAULT_SPELL`, by episode and start; empty where faults were not recorded. A fault
        whose value changes begins anew.
    """
    rows: list[tuple[int, int, int, int, int, float]] = []
    faults = record.steps.get("faults")
    if faults is None:
        return np.zeros(0, FAULT_SPELL)
    for kind, name in enumerate(FAULT_KINDS):
        if name not in (faults.dtype.names or ()):
            continue
        values, healthy = faults[name], np.float32(_HEALTHY[name])
        for episode, robot in zip(*np.nonzero((values != healthy).any(1)), strict=True):
            line = values[episode, : record.lengths[episode], robot]
            edges = np.flatnonzero(np.diff(line)) + 1
            for start, end in zip([0, *edges], [*edges, len(line)], strict=True):
                if start < end and line[start] != healthy:
                    number = record.first_episode + int(episode)
                    rows.append((number, int(robot), kind, start, end, float(line[start])))
    spells = np.array(rows, FAULT_SPELL)
    return spells[np.lexsort((spells["robot"], spells["start"], spells["episode"]))]


def blocked(record: Record) -> NDArray[np.bool_]:
    """Whether something in contact with a robot stopped it, at every step.

    A robot is blocked in a step if its drive alone would have moved it by more than 5 mm, if it
    moved less than half of that way, and if it touches a robot, a wall or an obstacle then.

    Returns:
        (E, T, R) bool; False at an episode's last step, whose end was not recorded.

    Raises:
        ValueError: actions, positions, velocities or faults were not recorded.
    """
    missing = {"actions", "positions", "velocities", "faults"} - set(record.steps)
    if missing:
        raise ValueError(f"record of {record.policy!r} lacks {', '.join(sorted(missing))}")
    positions = record.steps["positions"]
    found = np.zeros(positions.shape[:3], np.bool_)
    if positions.shape[1] < 2:
        return found
    going_on = np.arange(1, positions.shape[1]) < record.lengths[:, None]
    stopped = blocked_between(
        record.scenario,
        positions[:, :-1],
        positions[:, 1:],
        record.steps["velocities"][:, :-1],
        record.steps["actions"][:, :-1],
        record.steps["faults"][:, :-1],
        obstacle_places(record)[:, None],
        record.steps["headings"][:, :-1] if "headings" in record.steps else None,
    )
    found[:, :-1] = stopped & going_on[..., None]
    return found


def blocked_between(
    scenario: Scenario,
    before: NDArray[np.float32],
    after: NDArray[np.float32],
    velocities: NDArray[np.float32],
    actions: NDArray[Any],
    faults: NDArray[np.void],
    obstacles: NDArray[np.float32],
    headings: NDArray[np.float32] | None = None,
) -> NDArray[np.bool_]:
    """Whether something stopped each robot in a step; see `blocked`.

    Args:
        scenario: the world.
        before: (..., R, 2) places when the step began [m].
        after: (..., R, 2) places when it ended [m].
        velocities: (..., R, 2) when it began [m/s].
        actions: (..., R) integers, or (..., R, 2) where actions are continuous.
        faults: (..., R) structured, in effect in the step.
        obstacles: (..., O, 2) places of the obstacles [m].
        headings: (..., R, 2) angles [rad] and turn rates [rad/s] when it began, where robots have
            wheels; None: robots on wheels count as not stopped.

    Returns:
        (..., R) bool.
    """
    way = _free_way(scenario, velocities, actions, faults)
    if scenario.has_wheels:
        rolled = np.zeros_like(way)
        if headings is not None:
            rolled = _rolled_way(scenario, velocities, actions, faults, headings)
        way = np.where(np.array([[robot.has_wheels] for robot in scenario.robots]), rolled, way)
    length = np.linalg.norm(way, axis=-1)
    end = after.astype(np.float64)
    along = ((end - before) * way).sum(-1) / np.maximum(length, 1e-9)
    stopped = (length > _LEAST_WAY_M) & (along < _FREE_SHARE * length)
    return np.asarray(stopped & _touching(scenario, end, obstacles))


def _free_way(
    scenario: Scenario,
    velocities: NDArray[np.float32],
    actions: NDArray[Any],
    faults: NDArray[np.void],
) -> NDArray[np.float64]:
    """Where each robot's drive alone would have moved it within a step, (..., R, 2) [m]."""
    continuous = scenario.actions == "continuous"
    drive = actions.astype(np.float64) if continuous else _DIRECTIONS[actions]
    drive = drive / np.maximum(np.linalg.norm(drive, axis=-1, keepdims=True), 1.0)
    turn = faults["heading_bias"].astype(np.float64)
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = drive[..., 0], drive[..., 1]
    drive = np.stack([cos * x - sin * y, sin * x + cos * y], -1)
    drive *= (faults["motor_gain"] * (faults["unavailable"] == 0.0))[..., None]
    gain = np.array([robot.gain_mps(scenario.dt_s) for robot in scenario.robots])
    kept = np.array([robot.kept(scenario.damping) for robot in scenario.robots], np.float32)
    velocity = velocities * kept[:, None] + drive * gain[:, None]
    cap = np.array([robot.max_speed_mps for robot in scenario.robots]) * faults["speed_limit"]
    speed = np.linalg.norm(velocity, axis=-1)
    velocity = velocity * np.minimum(1.0, cap / np.maximum(speed, 1e-9))[..., None]
    driving = np.linalg.norm(drive, axis=-1) > 0.0
    return np.asarray(velocity * driving[..., None] * scenario.dt_s)


def _rolled_way(
    scenario: Scenario,
    velocities: NDArray[np.float32],
    actions: NDArray[Any],
    faults: NDArray[np.void],
    headings: NDArray[np.float32],
) -> NDArray[np.float64]:
    """Where wheels alone would have moved each robot within a step, (..., R, 2) [m]."""
    wheels = Wheels(scenario)
    gain = faults["motor_gain"] * (faults["unavailable"] == 0.0)
    bias = faults["heading_bias"].astype(np.float64)
    now = wheels.rolling(velocities.astype(np.float64), headings.astype(np.float64), bias)
    shares = wheels.shares(actions)
    then = wheels.after(now, shares, gain, faults["speed_limit"])
    driving = (shares[..., 0] != 0.0) & (gain > 0.0)
    way = wheels.velocities(headings[..., 0].astype(np.float64), then, bias) * scenario.dt_s
    return np.asarray(way * driving[..., None])


def _touching(
    scenario: Scenario, positions: NDArray[np.float64], obstacles: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Whether each robot touches a robot, a wall or an obstacle, (..., R)."""
    radius = np.array([robot.radius_m for robot in scenario.robots])
    touching = np.asarray(
        scenario.arena_half_width_m - np.abs(positions).max(-1) - radius < _TOUCH_M
    )
    gaps = np.linalg.norm(positions[..., :, None, :] - positions[..., None, :, :], axis=-1)
    gaps -= radius[:, None] + radius + _TOUCH_M
    layers = np.array([robot.layer for robot in scenario.robots])
    gaps[..., layers[:, None] != layers] = np.inf
    gaps[..., np.arange(len(radius)), np.arange(len(radius))] = np.inf
    touching |= (gaps < 0.0).any(-1)
    for number, shape in enumerate((*scenario.obstacles, *scenario.map_boxes)):
        is_moved = number < len(scenario.obstacles)
        centre = obstacles[..., number, None, :] if is_moved else np.array(shape.position_m)
        away = positions - centre
        if shape.half_extents_m is not None:
            half = np.array(shape.half_extents_m)
            away = away - np.clip(away, -half, half)
        gap = np.linalg.norm(away, axis=-1) - (shape.radius_m or 0.0) - radius
        touching |= (gap < _TOUCH_M) & np.array([shape.blocks(layer) for layer in layers.tolist()])
    return touching


def obstacle_places(record: Record) -> NDArray[np.float32]:
    """Where the obstacles stood in each episode, (E, O, 2) float32 [m].

    Records do not hold these places: the worlds are made again from their seed and number. No step
    is played.
    """
    if not record.scenario.obstacles:
        return np.zeros((record.num_episodes, 0, 2), np.float32)
    first = record.first_episode
    worlds = BatchEnv(
        record.scenario, record.num_episodes, record.seed, num_threads=1, first_env=first
    )
    with worlds:
        worlds.reset()
        return worlds.obstacles()
