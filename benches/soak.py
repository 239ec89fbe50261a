"""Long work must not grow: memory, threads and open files of many env-steps and a long training.

`python benches/soak.py` steps 10^8 env-steps with each engine and trains for an hour; `--parts`
takes some of the three. It exits with 1 where something does not hold. The first tenth is a
warm-up. What the process holds at least in the second tenth is compared with what it holds at least
in the last one: the memory that a checkpoint or an allocator borrows comes and goes by some per
cent, a leak stays. Each part that is not shortened is kept for `docs/reliability.md` as soon as it
is done; `--json FILE` keeps the details of any.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, astuple, dataclass
from pathlib import Path

import numpy as np
from reliability import publish
from reliability_kept import FILE, PAGE, Result, commit, keep, now
from reliability_rows import SOAK

from innerattn.config import Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.train import Progress, train

TENTH = 0.1
MOST_GROWTH = 0.01
ENV_STEPS = 10**8
MINUTES = 60.0
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
        warm: the least that was held in the second tenth, after the warm-up.
        end: the least that was held in the last tenth.
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
    threads = len(os.listdir("/proc/self/task"))
    return State(pages * os.sysconf("SC_PAGE_SIZE"), threads, files)


class Watched:
    """What the process holds in the second and in the last tenth of its work."""

    def __init__(self) -> None:
        """Nothing was seen."""
        self._start = time.perf_counter()
        self._looked = 0.0
        self._warm: list[State] = []
        self._end: list[State] = []

    @property
    def seconds(self) -> float:
        """Since the start."""
        return time.perf_counter() - self._start

    def look(self, done: float) -> None:
        """See what is held now, once a second at most.

        Args:
            done: share of the work.
        """
        between = self._warm and 2.0 * TENTH <= done < 1.0 - TENTH
        if done < TENTH or between:
            return
        seen = self._warm if done < 1.0 - TENTH else self._end
        if not seen or self.seconds >= self._looked + 1.0:
            self._looked = self.seconds
            seen.append(state())

    def soaked(self, name: str, env_steps: int, problems: Sequence[str] = ()) -> Soaked:
        """The account of finished work."""
        warm, end = (
            State(*map(min, zip(*map(astuple, seen), strict=True)))
            for seen in (self._warm, self._end)
        )
        growth = end.resident_bytes / warm.resident_bytes - 1.0
        found = list(problems)
        if growth > MOST_GROWTH:
            found.append(f"memory grew by {growth:.1%} after the warm-up")
        if end.threads > warm.threads:
            found.append(f"{end.threads - warm.threads} threads more than after the warm-up")
        if end.files > warm.files:
            found.append(f"{end.files - warm.files} open files more than after the warm-up")
        return Soaked(name, env_steps, self.seconds, warm, end, growth, tuple(found))


def soak_worlds(engine: str, env_steps: int) -> Soaked:
    """Random steps, with faults of the caller, resets of some worlds and snapshots now and then."""
    scenario = Scenario.preset("mixed-faults").replace(engine=engine)
    rng = np.random.default_rng(0)
    total = max(-(-env_steps // NUM_ENVS), 100)
    watched, problems = Watched(), []
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
            watched.look((step + 1) / total)
        return watched.soaked(f"worlds, {engine}", total * NUM_ENVS, problems[:5])


class TimeIsUpError(Exception):
    """The time is up."""


def soak_training(minutes: float) -> Soaked:
    """A training of TD with inner attention, whose replay is full after the warm-up."""
    overrides = {"train.env_steps": 10**9, "td.replay_capacity": 20_000}
    config = load_run_config("mixed", "td-inner", "short", overrides=overrides)
    watched, steps = Watched(), 0

    def watch(progress: Progress) -> None:
        nonlocal steps
        steps = progress.env_steps
        done = watched.seconds / (60.0 * minutes)
        watched.look(done)
        if done >= 1.0:
            raise TimeIsUpError

    with tempfile.TemporaryDirectory() as folder, suppress(TimeIsUpError):
        train(config, Path(folder) / "run", progress=watch)
    return watched.soaked("training, td-inner", steps)


def result_of(one: Soaked) -> Result:
    """What the scoreboard shows of finished work."""
    notes = [f"{one.name}: {one.env_steps:,} env-steps, memory {one.growth:+.2%}."]
    notes += [f"{one.name}: {problem}." for problem in one.problems]
    failed = bool(one.problems)
    return Result(1 - failed, int(failed), notes=tuple(x[0].upper() + x[1:] for x in notes))


PARTS: dict[str, Callable[[int, float], Soaked]] = {
    "discs": lambda env_steps, _: soak_worlds("discs", env_steps),
    "rapier": lambda env_steps, _: soak_worlds("rapier", env_steps),
    "training": lambda _, minutes: soak_training(minutes),
}
"""By name; each is told how many env-steps and how many minutes the whole is to take."""


def main() -> int:
    """Soak, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--env-steps", type=int, default=ENV_STEPS, help="of each engine's worlds")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="of training")
    parser.add_argument("--json", type=Path, help="where to keep what was found")
    options = parser.parse_args()
    full = options.env_steps >= ENV_STEPS and options.minutes >= MINUTES
    found = []
    for name in options.parts:
        tree = commit()
        one = PARTS[name](options.env_steps, options.minutes)
        found.append(one)
        verdict = "; ".join(one.problems) or "holds"
        print(
            f"{one.name}: {one.env_steps:,} env-steps in {one.seconds:,.0f} s, "
            f"memory {one.growth:+.2%}: {verdict}",
            flush=True,
        )
        if options.json:
            options.json.write_text(json.dumps([asdict(done) for done in found], indent=1))
        if full:
            keep(FILE, f"{SOAK} {name}", now(result_of(one), (f"{SOAK} {name}",), tree))
            publish(FILE, PAGE)
    return int(any(one.problems for one in found))


if __name__ == "__main__":
    sys.exit(main())
