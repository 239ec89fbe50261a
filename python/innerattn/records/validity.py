"""What a record cannot be, whatever the file says that it was read from."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.envs.batch import NUM_DISCRETE_ACTIONS
from innerattn.records.record import Record

_MOST_EPISODE = 2**53
_KINDS = "biuf"
_HALF_CIRCLE = float(np.float32(np.pi))  # as worlds hold it
_MOST_TURN = 1e4  # rad/s
_MOST_SPEED_MPS = 1e4  # worlds take no more, see `BatchEnv.set_state`
_MOST_SEEN = 1e6
_MOST_REWARD = 1e12
_MOST_FAULT = 1e3
_ROUNDING = 1e-3


def step_dtype(text: Any) -> np.dtype[Any]:
    """The dtype that a file names: numbers, or fields of numbers.

    Raises:
        ValueError: it is something else.
    """
    dtype = np.dtype(text if isinstance(text, str) else [(name, kind) for name, kind in text])
    parts = [dtype[name] for name in dtype.names] if dtype.names else [dtype]
    if any(part.kind not in _KINDS or part.itemsize > 8 or part.shape for part in parts):
        raise ValueError(f"dtype {str(dtype)[:80]}: must be numbers of at most 64 bits")
    return dtype


def step_shape(rows: int, shape: Any, length: int, found: int) -> tuple[int, ...]:
    """The shape of what was recorded step by step, if it is that of what is there.

    Args:
        rows: episodes E.
        shape: what the file names, (T, ...).
        length: steps of an episode T.
        found: numbers that are there.

    Raises:
        ValueError: it is not.
    """
    sizes = [rows, *shape]
    if not all(isinstance(size, int) and 0 <= size < 2**31 for size in sizes) or len(sizes) > 8:
        raise ValueError(f"shape {str(shape)[:80]}: must be a few sizes")
    if sizes[1:2] != [length] or math.prod(sizes) != found:
        raise ValueError(f"shape {sizes}: must have {length} steps and {found} numbers")
    return tuple(sizes)


def refuse_impossible(record: Record) -> None:
    """Refuse numbers that no play leaves behind.

    Raises:
        ValueError: one that names what is wrong.
    """
    scenario = record.scenario
    _within("seed", record.seed, 0, 2**64 - 1)
    _within("first episode", record.first_episode, 0, _MOST_EPISODE)
    if record.robot_names != tuple(robot.name for robot in scenario.robots):
        raise ValueError("robot names: must be those of the scenario")
    _all_within("steps", record.lengths, 1, scenario.episode_steps)
    for what, events in (("rescue", record.rescues), ("loss", record.lost)):
        episodes = events["episode"] - record.first_episode
        _all_within(f"episode of a {what}", episodes, 0, record.num_episodes - 1)
        _all_within(f"slot of a {what}", events["slot"], 0, scenario.num_victims - 1)
        _all_within(f"victim of a {what}", events["victim"], 0, 2**32 - 1)
        if (events["step"] < 0).any() or (events["step"] >= record.lengths[episodes]).any():
            raise ValueError(f"step of a {what}: must be one of its episode")
    _all_within("task of a loss", record.lost["task"], 0, len(scenario.tasks) - 1)
    if record.turned_away is not None:
        _all_within("turned away", record.turned_away, 0, _MOST_EPISODE)
    for name, values in {"reward": record.rewards_total, **record.steps}.items():
        for part in [values[field] for field in values.dtype.names or ()] or [values]:
            if not np.isfinite(part).all():
                raise ValueError(f"{name}: must be finite")
    _refuse_impossible_senses(record)
    for name, values, low, high in _ranges(record):
        if values.size and not (low <= values.min() and values.max() <= high):
            raise ValueError(f"{name}: must be in {low:g}..={high:g}")


def _refuse_impossible_senses(record: Record) -> None:
    scenario, steps = record.scenario, record.steps
    robots = scenario.num_robots
    for name, there, size in (
        ("heard", scenario.limits_communication, robots),
        ("rays", scenario.max_rays > 0, scenario.max_rays),
    ):
        if name not in steps:
            continue
        if not there:
            raise ValueError(f"{name}: must not be recorded in a scenario without it")
        if steps[name].shape[2:] != (robots, size):
            raise ValueError(f"{name}: must have shape (..., {robots}, {size})")
    if "heard" in steps and steps["heard"][..., range(robots), range(robots)].any():
        raise ValueError("heard: no robot hears itself")


def _ranges(record: Record) -> Iterator[tuple[str, NDArray[Any], float, float]]:
    """What was recorded step by step, and the least and the most that worlds can hold."""
    scenario, steps = record.scenario, record.steps
    half = float(np.float32(scenario.arena_half_width_m))  # as worlds hold it
    sizes = {
        "obs": _MOST_SEEN,
        "positions": half,
        "velocities": _MOST_SPEED_MPS,
        "rewards": _MOST_REWARD,
    }
    for name, size in sizes.items():
        if name in steps:
            yield name, steps[name], -size, size
    for name in ("attention", "actor_attention"):
        if name in steps:
            yield name, steps[name], -_ROUNDING, 1.0 + _ROUNDING
    if "headings" in steps:
        yield "heading", steps["headings"][..., 0], -_HALF_CIRCLE, _HALF_CIRCLE
        yield "turn rate", steps["headings"][..., 1], -_MOST_TURN, _MOST_TURN
    for name in ("charge", "load", "heard", "rays"):
        if name in steps:
            yield name, steps[name], 0.0, 1.0
    if "actions" in steps:
        low, high = (-1, 1) if scenario.actions == "continuous" else (0, NUM_DISCRETE_ACTIONS - 1)
        yield "actions", steps["actions"], low, high
    if "victims" in steps:
        victims = steps["victims"][steps["victims"]["present"]]
        yield "task of a victim", victims["task"], 0, len(scenario.tasks) - 1
        yield "id of a victim", victims["id"], 0, 2**32 - 1
        yield "appeared_step of a victim", victims["appeared_step"], 0, scenario.episode_steps
        for axis in "xy":
            yield f"{axis} of a victim", victims[axis], -half, half
        if "served" in (victims.dtype.names or ()):
            yield "served of a victim", victims["served"], 0, 1
        if "deadline_step" in (victims.dtype.names or ()):
            yield "deadline_step of a victim", victims["deadline_step"], -1, 2**32
    for kind in steps["faults"].dtype.names or () if "faults" in steps else ():
        yield f"fault {kind}", steps["faults"][kind], -_MOST_FAULT, _MOST_FAULT


def _within(name: str, value: Any, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{name} = {str(value)[:80]}: must be in {low}..={high}")


def _all_within(name: str, values: NDArray[Any], low: int, high: int) -> None:
    if values.dtype.kind not in "iu":
        raise ValueError(f"{name}: must be whole numbers")
    if len(values) and not (low <= int(values.min()) and int(values.max()) <= high):
        raise ValueError(f"{name}: must be in {low}..={high}")
