"""What an update of PPO costs in teams of 4 to 64 robots: time, products, and the bound it sets.

`python benches/large_teams.py` fills its place in `docs/performance.md`. One thread, compiled
updates of 512 rows of random numbers, with the networks of the budget `fast`.
"""

from __future__ import annotations

import statistics
import time
from contextlib import closing

import torch
from page import machine, publish, table
from torch.profiler import ProfilerActivity, profile

from innerattn.config import load_run_config
from innerattn.envs import BatchEnv
from innerattn.learn.framed import unframed
from innerattn.learn.ppo import PPO
from innerattn.learn.rollout import Rollout
from innerattn.train.build import build_learner
from innerattn.train.matmul_backend import chosen_matmul_backend

PRESETS = ("mixed", "mixed-8", "mixed-16", "rescue-16", "rescue-64")
METHODS = ("ppo-inner", "mappo")
PRECISIONS = ("float32", "bfloat16")
ROWS = 512
REPEATS = 15
PRODUCTS = ("aten::bmm", "aten::baddbmm", "aten::mm", "aten::addmm")


def learner(preset: str, method: str, precision: str) -> PPO:
    """A compiled learner with initial weights."""
    changed = {"network.precision": precision}
    config = load_run_config(preset, method=method, budget="fast", overrides=changed)
    with closing(BatchEnv(config.scenario, 2, num_threads=1)) as env:
        made = unframed(build_learner(config, env, training=True))
    assert isinstance(made, PPO)
    made.compile()
    return made


def random_rows(robots: int, width: int) -> Rollout:
    """Rows in the memory layout of a rollout: worlds before robots."""
    return Rollout(
        obs=torch.randn(ROWS, robots, width).transpose(0, 1),
        actions=torch.randint(5, (robots, ROWS)),
        log_prob=-torch.rand(robots, ROWS),
        advantage=torch.randn(robots, ROWS),
        target=torch.randn(robots, ROWS),
    )


def measure(preset: str, method: str, precision: str) -> tuple[int, int, float, float]:
    """Robots, observation columns, milliseconds of an update, and those of its products."""
    torch.compiler.reset()
    made = learner(preset, method, precision)
    robots, width = made._team.num_robots, made._team.obs_width
    rows = random_rows(robots, width)
    times = []
    for repeat in range(-2, REPEATS):  # the first two compile and warm up
        start = time.perf_counter()
        made.update(rows)
        if repeat >= 0:
            times.append(1e3 * (time.perf_counter() - start))
    with profile(activities=[ProfilerActivity.CPU]) as seen:
        for _ in range(3):
            made.update(rows)
    taken = sum(one.self_cpu_time_total for one in seen.key_averages() if one.key in PRODUCTS)
    return robots, width, statistics.median(times), taken / 3e3


def main() -> None:
    """Measure and publish."""
    torch.set_num_threads(1)
    rows = []
    with chosen_matmul_backend("auto"):
        for preset in PRESETS:
            for method in METHODS:
                for precision in PRECISIONS:
                    robots, width, update, products = measure(preset, method, precision)
                    # `fast` passes over each row twice.
                    most = ROWS / (2e-3 * update)
                    cells = [f"{preset}, {method}, {precision}", str(robots), str(width)]
                    rows.append([*cells, f"{update:.1f}", f"{products:.1f}", f"{most:,.0f}"])
    head = ["`fast`", "robots", "columns", "update, ms", "products, ms", "env-steps/s at most"]
    publish("large_teams", f"{machine('torch')}.\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
