"""Speed of the default worlds beside those of an older version, in turn, and whether both agree.

`python benches/older_worlds.py FOLDER` fills its place in `docs/performance.md`. FOLDER is
`python` of a checkout of the older version, with its compiled module. Mixed worlds, random discrete
actions, all cores, `copy=False`, Python call included.
"""

from __future__ import annotations

import hashlib
import statistics
import sys
import time

import numpy as np
from versions import older_and_now

ENGINES = ("rapier", "discs")
BATCHES = (1, 1_024, 4_096)
ROUNDS = 41
ROUND_S = 0.2
DIGEST_STEPS = 200


def measure() -> None:
    """In a process of one version: answer each line "ENGINE BATCH" by a rate, after a digest."""
    from innerattn.config import Scenario
    from innerattn.envs import BatchEnv

    worlds, actions = {}, {}
    for line in sys.stdin:
        engine, batch = line.split()
        num_envs = int(batch)
        if (engine, num_envs) not in worlds:
            scenario = Scenario.preset("mixed").replace(engine=engine)
            env = BatchEnv(scenario, num_envs, copy=False, seed=0)
            drawn = np.random.default_rng(0).integers(0, 5, (16, num_envs, scenario.num_robots))
            worlds[engine, num_envs], actions[engine, num_envs] = env, drawn
            digest = hashlib.sha256(env.reset().tobytes())
            for step in range(DIGEST_STEPS):
                digest.update(env.step(drawn[step % 16]).obs.tobytes())
            print(digest.hexdigest(), flush=True)
            continue
        env, drawn = worlds[engine, num_envs], actions[engine, num_envs]
        steps, start = 0, time.perf_counter()
        while time.perf_counter() - start < ROUND_S:
            env.step(drawn[steps % 16])
            steps += 1
        print(steps * num_envs / (time.perf_counter() - start), flush=True)


def main() -> None:
    """Measure and publish."""
    if sys.argv[1:] == ["--measure"]:
        measure()
        return
    from page import machine, publish, table

    versions = older_and_now(__file__)
    rows = []
    for engine in ENGINES:
        for batch in BATCHES:
            digests = [version.ask(engine, batch) for version in versions]
            rates = [
                [float(version.ask(engine, batch)) for version in versions] for _ in range(ROUNDS)
            ]
            older, now = (statistics.median(column) for column in zip(*rates, strict=True))
            ratio = statistics.median(new / old for old, new in rates[1:])
            same = "yes" if digests[0] == digests[1] else "no"
            cells = [engine, f"{batch:,}", f"{older:,.0f}", f"{now:,.0f}", f"{ratio:.3f}", same]
            rows.append(cells)
    head = ["env-steps/s", "worlds", "before", "now", "ratio", "same bits"]
    publish("older_worlds", f"{machine('numpy')}.\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
