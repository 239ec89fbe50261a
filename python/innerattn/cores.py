"""How many cores there are to work with, and how threads share them with other programs."""

from __future__ import annotations

import os
import sys


def usable_cores() -> int:
    """Cores that this process may use, or where the system does not tell, all there are."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def let_waiting_threads_sleep() -> None:
    """Let threads of OpenMP sleep while they wait for each other; before torch is imported.

    By default they spin. Where another program takes one of the cores, spinning threads make
    updates many times slower, because the one that all others wait for does not get to run. Results
    are the same. What the user has set is left alone.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
