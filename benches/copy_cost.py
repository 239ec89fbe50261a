"""What a step's own arrays cost: env-steps a second with `copy=True` and `copy=False`, in turn.

`python benches/copy_cost.py` fills its place in `docs/performance.md`. Mixed worlds, random
discrete actions, all cores, Python call included.
"""

from __future__ import annotations

import statistics
import time

import numpy as np
from page import machine, publish, table

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

ENGINES = ("rapier", "discs")
BATCHES = (1, 1024, 4096)
ROUNDS = 21
ROUND_S = 0.1


def rates(engine: str, num_envs: int) -> dict[bool, list[float]]:
    """Env-steps a second by `copy`, one number a round; both take turns in every round."""
    scenario = Scenario.preset("mixed").replace(engine=engine)
    actions = np.random.default_rng(0).integers(0, 5, (16, num_envs, scenario.num_robots))
    envs = {copy: BatchEnv(scenario, num_envs, copy=copy) for copy in (True, False)}
    found: dict[bool, list[float]] = {copy: [] for copy in envs}
    for env in envs.values():
        env.reset()
    for round_index in range(ROUNDS + 1):
        for copy, env in envs.items():
            steps, start = 0, time.perf_counter()
            while time.perf_counter() - start < ROUND_S:
                env.step(actions[steps % 16])
                steps += 1
            if round_index:
                found[copy].append(steps * num_envs / (time.perf_counter() - start))
    for env in envs.values():
        env.close()
    return found


def main() -> None:
    """Measure and publish."""
    head = ["env-steps/s", "worlds", "copy=False", "copy=True", "share", "µs a step"]
    rows = []
    for engine in ENGINES:
        for num_envs in BATCHES:
            found = rates(engine, num_envs)
            pairs = list(zip(found[True], found[False], strict=True))
            share = statistics.median(own / lent for own, lent in pairs)
            cost = statistics.median(1e6 * num_envs * (1 / own - 1 / lent) for own, lent in pairs)
            speeds = [f"{statistics.median(found[copy]):,.0f}" for copy in (False, True)]
            rows.append([engine, f"{num_envs:,}", *speeds, f"{share:.3f}", f"{cost:,.1f}"])
    publish("copy_cost", f"{machine('numpy')}.\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
