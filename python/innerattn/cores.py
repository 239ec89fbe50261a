"""How many cores there are to work with."""

from __future__ import annotations

import os
import sys


def usable_cores() -> int:
    """Cores that this process may use, or where the system does not tell, all there are."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
