"""What `enhanced-determinism` of rapier costs: a step with it and without, in turn.

`python benches/determinism_cost.py` builds the compiled module without it, in
`target/without_determinism`, and prints a table. It publishes nothing. It counts the processor's
time on one thread, which other programs on the machine hardly change.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from page import machine, table

import innerattn
from innerattn.config import Scenario
from innerattn.envs import BatchEnv

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "target" / "without_determinism"
WORLDS = {"mixed": 1024, "mixed-16": 256}
"""Worlds of a batch, by preset: 4 and 16 robots, with rapier."""
PROCESSES, ROUNDS, STEPS = 5, 5, 40


def built_without() -> Path:
    """The compiled module without it."""
    command = ["cargo", "build", "--release", "--locked", "--target-dir", str(TARGET)]
    command += ["-p", "innerattn-py", "--no-default-features"]
    subprocess.run([*command, "--features", "pyo3/extension-module"], cwd=ROOT, check=True)
    return TARGET / "release" / "lib_core.so"


def package_with(module: Path, folder: Path) -> Path:
    """A copy of the package with another compiled module, for PYTHONPATH."""
    source = Path(innerattn.__file__).parent
    ignored = shutil.ignore_patterns("__pycache__", "_core*.so")
    shutil.copytree(source, folder / "innerattn", ignore=ignored)
    shutil.copy(module, folder / "innerattn" / "_core.abi3.so")
    return folder


def microseconds() -> list[float]:
    """Of one core for an env-step, for each preset; the median of the rounds of this process."""
    found = []
    for preset, worlds in WORLDS.items():
        scenario = Scenario.preset(preset)
        with BatchEnv(scenario, worlds, seed=0, num_threads=1, copy=False) as env:
            shape = (32, worlds, env.num_robots)
            actions = np.random.default_rng(0).integers(0, env.num_actions, shape)
            env.reset()
            rounds = []
            for _ in range(ROUNDS + 1):
                start = time.process_time()
                for step in range(STEPS):
                    env.step(actions[step % 32])
                rounds.append(1e6 * (time.process_time() - start) / (STEPS * worlds))
        found.append(statistics.median(rounds[1:]))
    return found


def elsewhere(folder: Path) -> list[float]:
    """`microseconds` of a process that imports the package from ``folder``."""
    env = {**os.environ, "PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--measure"]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()]


def main() -> None:
    """Measure and print; with ``--measure``, in this process alone."""
    if sys.argv[1:] == ["--measure"]:
        print(*microseconds())
        return
    from innerattn import _core

    with tempfile.TemporaryDirectory() as place:
        modules = {"with": Path(_core.__file__), "without": built_without()}
        folders = {name: package_with(one, Path(place) / name) for name, one in modules.items()}
        found: dict[str, list[list[float]]] = {name: [] for name in folders}
        for _ in range(PROCESSES):
            for name, folder in folders.items():
                found[name].append(elsewhere(folder))
    rows = []
    for index, preset in enumerate(WORLDS):
        having, lacking = (
            statistics.median(one[index] for one in found[name]) for name in ("with", "without")
        )
        rows.append([preset, f"{having:.2f}", f"{lacking:.2f}", f"{having / lacking - 1.0:+.1%}"])
    head = ["µs of a core an env-step", "with", "without", "cost"]
    print(f"{machine('numpy')}.\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
