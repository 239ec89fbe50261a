"""Speed of the default worlds beside those of an older version, in turn, and whether both agree.

`python benches/older_worlds.py FOLDER` fills its place in `docs/performance.md`. FOLDER is
`python` of a checkout of the older version, with its compiled module. Mixed worlds, random discrete
actions, all cores, `copy=False`, Python call included.
"""

from __future__ import annotations

import hashlib
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

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


class Version:
    """A process that measures one version.

    Args:
        python: its `PYTHONPATH`.
    """

    def __init__(self, python: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__, "--measure"],
            env=os.environ | {"PYTHONPATH": str(python)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, engine: str, batch: int) -> str:
        """What it answers."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{engine} {batch}\n")
        self._process.stdin.flush()
        return self._process.stdout.readline().strip()


def main() -> None:
    """Measure and publish."""
    if len(sys.argv) != 2:
        sys.exit(f"usage: python {sys.argv[0]} FOLDER")
    if sys.argv[1] == "--measure":
        measure()
        return
    from page import machine, publish, table

    versions = [Version(Path(sys.argv[1])), Version(Path(__file__).parents[1] / "python")]
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
