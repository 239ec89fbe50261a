"""Metrics of a training run, one JSON line per logging interval.

`Interval` collects what happens between two lines, `MetricsFile` writes a line.
"""

from __future__ import annotations

import errno
import json
import os
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.errors import RunError
from innerattn.train.collect import Tally

Metrics = Mapping[str, Any]
"""One line: env_steps, episodes, updates, seconds, env_steps_per_s, updates_per_s, losses by name,
rescues_per_episode (none where no episode ended) and attention_entropy by robot and head [nats],
empty where the critic has no attention."""


class MetricsFile:
    """A file to which whole lines are appended."""

    def __init__(self, path: Path) -> None:
        """Append to ``path``; the first line creates the file."""
        self._path = path

    def append(self, metrics: Metrics) -> None:
        """Add one line.

        Raises:
            RunError: training has diverged.
            OSError: the line cannot be written; the file is as it was.
        """
        refuse_divergence(metrics, metrics["env_steps"])
        line = f"{json.dumps(metrics, allow_nan=False)}\n".encode()
        # One write of one line to a file opened for appending: a reader never sees half of it.
        with self._path.open("ab", buffering=0) as file:
            before = file.tell()
            if file.write(line) < len(line):  # the disk is full, say
                file.truncate(before)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self._path))


class Interval:
    """Counts and losses since the last line of metrics."""

    def __init__(self) -> None:
        """Start at zero steps, now."""
        self._start = time.perf_counter()
        self._seconds = 0.0
        self._env_steps = 0
        self._updates = 0
        self._losses: dict[str, list[float]] = {}

    @property
    def seconds(self) -> float:
        """Time since the start of training [s]."""
        return time.perf_counter() - self._start

    def add_losses(self, losses: Mapping[str, float]) -> None:
        """Add the losses of one control step; none if no update was due."""
        for name, value in losses.items():
            self._losses.setdefault(name, []).append(value)

    def close(
        self, env_steps: int, updates: int, tally: Tally, entropy: Mapping[str, list[float]]
    ) -> dict[str, Any]:
        """Return the line of this interval, and start the next one."""
        seconds = self.seconds
        elapsed = max(seconds - self._seconds, 1e-9)
        line: dict[str, Any] = {
            "env_steps": env_steps,
            "episodes": tally.total_episodes,
            "updates": updates,
            "seconds": round(seconds, 3),
            "env_steps_per_s": round((env_steps - self._env_steps) / elapsed, 1),
            "updates_per_s": round((updates - self._updates) / elapsed, 2),
            "losses": {name: sum(all_) / len(all_) for name, all_ in self._losses.items()},
            "rescues_per_episode": tally.rescues / tally.episodes if tally.episodes else None,
            "attention_entropy": dict(entropy),
        }
        self._seconds, self._env_steps, self._updates = seconds, env_steps, updates
        self._losses = {}
        return line


def refuse_divergence(metrics: Mapping[str, Any], env_steps: int) -> None:
    """Stop a training whose metrics are not finite.

    Args:
        metrics: numbers, lists of numbers and None, by name, nested or not.
        env_steps: when they were computed.

    Raises:
        RunError: a metric is not finite; the message names it and its value.
    """
    for name, values in _flat(metrics):
        bad = values[~np.isfinite(values)]
        if bad.size:
            raise RunError(
                f"training diverged at env_steps = {env_steps}: {name} = {bad[0]}: must be finite"
            )


def _flat(metrics: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        elif value is not None:
            yield prefix + name, np.atleast_1d(value)
