"""Workers of a study as processes of this machine."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from innerattn.cores import usable_cores
from innerattn.errors import RunError

_LOOK_EVERY_S = 0.5
_MOST_DEATHS = 5
_KILL_AFTER_S = 120.0


def run_workers(
    folder: Path,
    count: int,
    *,
    looked: Callable[[], int],
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Start workers and wait until nothing is left to do; one that dies is replaced.

    Args:
        folder: of the study.
        count: how many.
        looked: called now and then; gives the number of runs that are done or failed.
        clock: seconds.

    Raises:
        RunError: workers die again and again while no run ends.
        KeyboardInterrupt: after all workers have saved their runs and are gone; a second one ends
            them at once.
    """
    words = [sys.executable, "-m", "innerattn", "study", "work", str(folder), "--quiet"]
    workers = [subprocess.Popen(words) for _ in range(count)]
    deaths, over = 0, looked()
    try:
        while any(worker.poll() is None for worker in workers):
            time.sleep(_LOOK_EVERY_S)
            now = looked()
            deaths, over = (0 if now > over else deaths), now
            for index, worker in enumerate(workers):
                if worker.poll() not in (None, 0):
                    deaths += 1
                    if deaths > _MOST_DEATHS:
                        raise RunError(
                            f"{folder}: workers end before a run does, the last one with code "
                            f"{worker.returncode}; innerattn study work {folder} shows why"
                        )
                    workers[index] = subprocess.Popen(words)
    finally:
        _end(workers, clock)


def _end(workers: list[subprocess.Popen[bytes]], clock: Callable[[], float]) -> None:
    """Ask the workers to save what they do, wait for them, and end those that do not answer."""
    for worker in workers:
        if worker.poll() is None:
            worker.send_signal(signal.SIGTERM)
    last = clock() + _KILL_AFTER_S
    try:
        for worker in workers:
            worker.wait(max(0.0, last - clock()))
    except (KeyboardInterrupt, subprocess.TimeoutExpired):
        for worker in workers:
            worker.kill()
        raise
    finally:
        for worker in workers:
            if worker.poll() is not None:
                worker.wait()


def as_many_as_cores(runs: int) -> int:
    """How many workers are worth it: one for each core, and no more than there are runs."""
    return max(1, min(usable_cores(), runs))
