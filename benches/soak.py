"""Long work must not grow: memory, threads and open files of many env-steps and a long training.

`python benches/soak.py` steps 10^8 env-steps and trains for an hour; it exits with 1 where
something does not hold. The first tenth is a warm-up. `--json FILE` keeps what was found.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from innerattn.config import Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.train import Progress, train

WARM_UP = 0.1
MOST_GROWTH = 0.01
NUM_ENVS = 1024
LOOK_EVERY = 50  # control steps


@dataclass(frozen=True)
class State:
    """What the process holds."""

    resident_bytes: int
    threads: int
    files: int


@dataclass(frozen=True)
class Soaked:
    """What a long piece of work left.

    Attributes:
        name: what was done.
        env_steps: how much of it.
        seconds: how long it took.
        warm: the state after the warm-up.
        end: the state at the end.
        growth: of resident memory between the two, as a share.
        problems: what does not hold; nothing where all does.
    """

    name: str
    env_steps: int
    seconds: float
    warm: State
    end: State
    growth: float
    problems: tuple[str, ...]


def state() -> State:
    """Now; of the system's own account of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    files = len(os.listdir("/proc/self/fd"))
    return State(pages * os.sysconf("SC_PAGE_SIZE"), threading.active_count(), files)


def soaked(
    name: str, env_steps: int, start: float, warm: State, problems: tuple[str, ...] = ()
) -> Soaked:
    """The account of finished work."""
    end = state()
    growth = end.resident_bytes / warm.resident_bytes - 1.0
    found = list(problems)
    if growth > MOST_GROWTH:
        found.append(f"memory grew by {growth:.1%} after the warm-up")
    if end.threads > warm.threads:
        found.append(f"{end.threads - warm.threads} threads more than after the warm-up")
    if end.files > warm.files:
        found.append(f"{end.files - warm.files} open files more than after the warm-up")
    return Soaked(name, env_steps, time.perf_counter() - start, warm, end, growth, tuple(found))


def soak_worlds(engine: str, env_steps: int) -> Soaked:
    """Random steps, with faults of the caller, resets of some worlds and snapshots now and then."""
    scenario = Scenario.preset("mixed-faults").replace(engine=engine)
    rng = np.random.default_rng(0)
    total = max(env_steps // NUM_ENVS, 100)
    start, warm, problems = time.perf_counter(), state(), []
    with BatchEnv(scenario, NUM_ENVS, 0, copy=False) as env:
        env.reset()
        chosen = rng.integers(0, env.num_actions, (64, NUM_ENVS, env.num_robots))
        radii = np.array([robot.radius_m for robot in scenario.robots])
        reach = scenario.arena_half_width_m - radii[:, None] + 2e-3
        for step in range(total):
            made = env.step(chosen[step % 64])
            if step % LOOK_EVERY == 0:
                if not (np.isfinite(made.obs).all() and np.isfinite(made.reward).all()):
                    problems.append(f"step {step}: a number is not finite")
                if (np.abs(env.positions()) > reach).any():
                    problems.append(f"step {step}: a robot is outside the arena")
            if step % 500 == 0:
                env.restore(env.snapshot())
                env.set_faults(env.fault_state(), rng.random(NUM_ENVS) < 0.1)
                env.reset(mask=rng.random(NUM_ENVS) < 0.1)
            if step == int(total * WARM_UP):
                warm = state()
        return soaked(f"worlds, {engine}", total * NUM_ENVS, start, warm, tuple(problems[:5]))


class TimeIsUpError(Exception):
    """The time is up."""


def soak_training(minutes: float) -> Soaked:
    """A training of TD with inner attention, whose replay is full after the warm-up."""
    overrides = {"train.env_steps": 10**9, "td.replay_capacity": 20_000}
    config = load_run_config("mixed", "td-inner", "short", overrides=overrides)
    start, last = time.perf_counter(), 60.0 * minutes
    seen: dict[str, State] = {}
    steps = 0

    def watch(progress: Progress) -> None:
        nonlocal steps
        steps = progress.env_steps
        elapsed = time.perf_counter() - start
        if "warm" not in seen and elapsed > WARM_UP * last:
            seen["warm"] = state()
        if elapsed > last:
            raise TimeIsUpError

    with tempfile.TemporaryDirectory() as folder, suppress(TimeIsUpError):
        train(config, Path(folder) / "run", progress=watch)
    return soaked("training, td-inner", steps, start, seen["warm"])


def main() -> int:
    """Soak, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--env-steps", type=int, default=10**8, help="of worlds, both engines")
    parser.add_argument("--minutes", type=float, default=60.0, help="of training")
    parser.add_argument("--json", type=Path, help="where to keep what was found")
    options = parser.parse_args()
    found = [
        soak_worlds("discs", options.env_steps * 9 // 10),
        soak_worlds("rapier", options.env_steps // 10),
        soak_training(options.minutes),
    ]
    for one in found:
        verdict = "; ".join(one.problems) or "holds"
        print(
            f"{one.name}: {one.env_steps:,} env-steps in {one.seconds:,.0f} s, "
            f"memory {one.growth:+.2%}: {verdict}"
        )
    if options.json:
        options.json.write_text(json.dumps([asdict(one) for one in found], indent=1))
    return int(any(one.problems for one in found))


if __name__ == "__main__":
    sys.exit(main())
