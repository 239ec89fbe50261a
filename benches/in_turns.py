"""Speeds of several ways to step worlds, measured in turn, so that a busy machine burdens all."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

ROUNDS = 15
ROUND_S = 0.3


def rates(steps: Mapping[str, Callable[[], object]], num_envs: int) -> dict[str, list[float]]:
    """Env-steps a second, one number a round; all take turns in every round.

    Args:
        steps: each does one step of all worlds.
        num_envs: how many worlds a step has.
    """
    found: dict[str, list[float]] = {name: [] for name in steps}
    for round_index in range(ROUNDS + 1):  # the first warms up
        for name, step in steps.items():
            count, start = 0, time.perf_counter()
            while time.perf_counter() - start < ROUND_S:
                step()
                count += 1
            if round_index:
                found[name].append(count * num_envs / (time.perf_counter() - start))
    return found
