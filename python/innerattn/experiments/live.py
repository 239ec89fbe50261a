"""A training as it stands: how far it is, and what it has logged so far. It trains nothing."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from innerattn.config import RunConfig
from innerattn.config.untrusted import read_plain
from innerattn.errors import RunError
from innerattn.records.logged import (
    METRICS,
    MOST_METRICS_BYTES,
    logged_lines,
    logged_rescues,
    unit_of_rescues,
)
from innerattn.records.run_folder import State, newest_weights, read_config, read_info

MOST_POINTS = 400
"""As many points of a course are kept; of longer ones every second, third, ..."""


@dataclass(frozen=True)
class LiveRun:
    """A run in training, or after it.

    Attributes:
        name: of its folder.
        method: of training.
        situation: of the worlds.
        seed: of training.
        state: "running", "done" or "interrupted".
        env_steps: done so far, imitation included.
        total_env_steps: to do in all.
        env_steps_per_s: in the last logging interval; None before the first.
        seconds_left: at that speed; None where it is not known or nothing is left.
        silent_s: since the last line was logged [s]; None before the first.
        checkpoint: env-steps of the newest checkpoint; None before the first.
        times: env-steps of the logged lines.
        rescues: at these, as `innerattn.records.logged.logged_rescues` counts them.
        rescues_per: what they are counted over: "episode", or "N steps" where rescues end episodes.
        entropy: attention entropy at these, mean over robots and heads [nats]; empty without.
        even_nats: the entropy of even attention; None below three robots.
    """

    name: str
    method: str
    situation: str
    seed: int
    state: State
    env_steps: int
    total_env_steps: int
    env_steps_per_s: float | None
    seconds_left: float | None
    silent_s: float | None
    checkpoint: int | None
    times: tuple[int, ...]
    rescues: tuple[float | None, ...]
    rescues_per: str
    entropy: tuple[float, ...]
    even_nats: float | None


def read_live(folder: Path) -> LiveRun:
    """How a run stands; nothing in its folder changes.

    Raises:
        RunError: there is no such run, or its metrics are damaged.
        ConfigError: its configuration is not valid.
    """
    info, config = read_info(folder), read_config(folder)
    path = folder / METRICS
    logged = _read_logged(path, config)
    total, robots = _total(config), config.scenario.num_robots
    done = max(info.env_steps, *(line.env_steps for line in logged[-1:]), 0)
    speed = logged[-1].env_steps_per_s if logged else None
    left = max(total - done, 0) / speed if speed and info.state == "running" else None
    kept = logged[:: -(math.ceil(len(logged) / MOST_POINTS) or 1)][::-1]  # the newest is kept
    entropy = tuple(line.entropy for line in kept if line.entropy is not None)
    return LiveRun(
        name=folder.resolve().name,
        method=config.train.method,
        situation=config.scenario.situation,
        seed=config.train.seed,
        state=info.state,
        env_steps=done,
        total_env_steps=total,
        env_steps_per_s=speed,
        seconds_left=left,
        silent_s=max(time.time() - path.stat().st_mtime, 0.0) if logged else None,
        checkpoint=_checkpoint(folder),
        times=tuple(line.env_steps for line in kept),
        rescues=tuple(line.rescues for line in kept),
        rescues_per=unit_of_rescues(config),
        entropy=entropy if len(entropy) == len(kept) else (),
        even_nats=math.log(robots - 1) if robots > 2 else None,
    )


class _Logged(NamedTuple):
    env_steps: int
    rescues: float | None
    entropy: float | None
    env_steps_per_s: float


def _read_logged(path: Path, config: RunConfig) -> list[_Logged]:
    """The lines of a metrics file; none before the first."""
    if not path.exists():
        return []
    try:
        data = read_plain(path, MOST_METRICS_BYTES)
        return [_logged(line, config) for line in logged_lines(data)]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: not the metrics of a run") from error


def _logged(line: dict[str, Any], config: RunConfig) -> _Logged:
    values = [value for heads in line["attention_entropy"].values() for value in heads]
    return _Logged(
        int(line["env_steps"]),
        logged_rescues(config, line),
        float(np.mean(values)) if values else None,
        float(line["env_steps_per_s"]),
    )


def _total(config: RunConfig) -> int:
    first = 0 if config.train.warm_start == "none" else config.imitation.env_steps
    return first + config.train.env_steps


def _checkpoint(folder: Path) -> int | None:
    try:
        return int(newest_weights(folder).parent.name)
    except RunError:
        return None
