"""Metrics of a training run, one JSON line per logging interval.

`Interval` collects what happens between two lines, `MetricsFile` writes a line.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.config.untrusted import parse_json, read_plain
from innerattn.errors import RunError
from innerattn.learn.resume import State, inside, take, take_within
from innerattn.records.logged import MOST_METRICS_BYTES
from innerattn.train.collect import Tally

_COUNTS = ("skipped_updates",)
Metrics = Mapping[str, Any]
"""One line: env_steps, episodes, updates, seconds, env_steps_per_s, updates_per_s, losses by name,
rescues_per_episode (of the episodes that ended; none where none did), rescues_per_env_step (of all
worlds), attention_entropy by robot and head [nats], empty where the critic has no attention, and
where victims can be lost lost_per_env_step, and where they arrive turned_away_per_env_step (both of
all worlds)."""


class MetricsFile:
    """A file to which whole lines are appended.

    Attributes:
        path: of the file.
        bytes: its length.
    """

    def __init__(self, path: Path) -> None:
        """Append to ``path``; the first line creates the file."""
        self.path = path
        self.bytes = 0
        self._digest = hashlib.sha256()
        self._unwritten: list[bytes] = []

    @property
    def sha256(self) -> str:
        """SHA-256 of the file, in hexadecimal."""
        return self._digest.hexdigest()

    def append(self, metrics: Metrics) -> None:
        """Add one line.

        Raises:
            RunError: training has diverged.
            OSError: the line cannot be written; the file is as it was, and the line comes with the
                next one or with `sync`.
        """
        refuse_divergence(metrics, metrics["env_steps"])
        self._unwritten.append(f"{json.dumps(metrics, allow_nan=False)}\n".encode())
        self._write()

    def sync(self) -> None:
        """Let all lines outlast a loss of power.

        Raises:
            OSError: they cannot be written.
        """
        self._write()
        if self.bytes:
            with self.path.open("rb") as file:
                try:
                    os.fsync(file.fileno())
                except OSError as error:
                    raise OSError(error.errno, error.strerror, str(self.path)) from error

    def go_on_after(self, length: int, sha256: str) -> Metrics | None:
        """Cut the file after its first ``length`` bytes, and append there.

        Returns:
            The last line that is left, if there is one.

        Raises:
            RunError: as of `verified`; the file is as it was.
            OSError: it cannot be written.
        """
        kept = self.verified(length, sha256)
        if length:
            os.truncate(self.path, length)
        else:
            self.path.unlink(missing_ok=True)
        self.bytes, self._digest = length, hashlib.sha256(kept)
        last: Metrics | None = parse_json(kept[kept.rfind(b"\n", 0, -1) + 1 :]) if kept else None
        return last

    def verified(self, length: int, sha256: str) -> bytes:
        """The first ``length`` bytes of the file.

        Raises:
            RunError: they are not there, or have another digest.
        """
        kept = read_plain(self.path, MOST_METRICS_BYTES)[:length] if length else b""
        if len(kept) < length or hashlib.sha256(kept).hexdigest() != sha256:
            raise RunError(f"{self.path}: is not that of the checkpoint; it was altered")
        return kept

    def _write(self) -> None:
        # One write of one line to a file opened for appending: a reader never sees half of it.
        while self._unwritten:
            line = self._unwritten[0]
            with self.path.open("ab", buffering=0) as file:
                before = file.tell()
                try:
                    if file.write(line) < len(line):  # the disk is full, say
                        file.truncate(before)
                        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                except OSError as error:
                    raise OSError(error.errno, error.strerror, str(self.path)) from error
            self._digest.update(line)
            self.bytes += len(line)
            del self._unwritten[0]


class Interval:
    """Counts and losses since the last line of metrics."""

    def __init__(self) -> None:
        """Start at zero steps, now."""
        self._start = time.perf_counter()
        self._cpu_start: float | None = time.process_time()
        self._seconds = 0.0
        self._env_steps = 0
        self._updates = 0
        self._losses: dict[str, list[float]] = {}

    @property
    def env_steps(self) -> int:
        """Env-steps of training at the last line."""
        return self._env_steps

    @property
    def seconds(self) -> float:
        """Time since the start of training [s]."""
        return time.perf_counter() - self._start

    @property
    def cpu_seconds(self) -> float | None:
        """Processor time of this process, all its threads, since the start of training [s].

        Processes of a compiler and other workers are not counted. None: training went on from a
        state that did not say how much there was before.
        """
        return None if self._cpu_start is None else time.process_time() - self._cpu_start

    def resume_state(self) -> dict[str, Tensor]:
        """Everything since the last line; see `Resumable`."""
        losses = {
            f"losses.{place:03}.{name}": torch.tensor(values, dtype=torch.float64)
            for place, (name, values) in enumerate(self._losses.items())
        }
        if self.cpu_seconds is not None:
            losses["cpu_seconds"] = torch.tensor([self.cpu_seconds], dtype=torch.float64)
        return losses | {
            "before": torch.tensor([self._env_steps, self._updates]),
            "seconds": torch.tensor([self.seconds, self._seconds], dtype=torch.float64),
        }

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`. The time until now does not count."""
        before = take_within(state, "before", torch.int64, 0, 2**62, 2)
        self._env_steps, self._updates = before.tolist()
        seconds, self._seconds = take(state, "seconds", torch.float64, 2).tolist()
        self._start = time.perf_counter() - seconds
        self._cpu_start = None
        if "cpu_seconds" in state:  # states of 0.1.0 do not have it
            (cpu_seconds,) = take(state, "cpu_seconds", torch.float64, 1).tolist()
            self._cpu_start = time.process_time() - cpu_seconds
        losses = inside("losses", state)
        self._losses = {
            name.partition(".")[2]: take(losses, name, torch.float64, None).tolist()
            for name in sorted(losses)
        }

    def add_losses(self, losses: Mapping[str, float]) -> None:
        """Add the losses of one control step; none if no update was due."""
        for name, value in losses.items():
            self._losses.setdefault(name, []).append(value)

    def close(
        self, env_steps: int, updates: int, tally: Tally, entropy: Mapping[str, list[float]]
    ) -> dict[str, Any]:
        """Return the line of this interval, and start the next one."""
        seconds = self.seconds
        elapsed, steps = max(seconds - self._seconds, 1e-9), env_steps - self._env_steps
        line: dict[str, Any] = {
            "env_steps": env_steps,
            "episodes": tally.total_episodes,
            "updates": updates,
            "seconds": round(seconds, 3),
            "env_steps_per_s": round(steps / elapsed, 1),
            "updates_per_s": round((updates - self._updates) / elapsed, 2),
            "losses": {name: _summary(name, all_) for name, all_ in self._losses.items()},
            "rescues_per_episode": tally.rescues / tally.episodes if tally.episodes else None,
            "rescues_per_env_step": tally.all_rescues / max(steps, 1),
            "attention_entropy": dict(entropy),
        }
        if tally.all_lost is not None:
            line["lost_per_env_step"] = tally.all_lost / max(steps, 1)
        if tally.all_turned_away is not None:
            line["turned_away_per_env_step"] = tally.all_turned_away / max(steps, 1)
        self._seconds, self._env_steps, self._updates = seconds, env_steps, updates
        self._losses = {}
        return line


def _summary(name: str, values: list[float]) -> float:
    """The mean, or the sum of what counts."""
    return sum(values) if name in _COUNTS else sum(values) / len(values)


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
