"""Env-steps per second of `BatchEnv` from Python: default mixed scenario, random actions, 25 steps.

Everything is written in each step (observations, rewards, events, autoreset). Prints the median of
five rounds for each batch size and number of threads, and its ratio to one thread.
"""

import platform
import statistics
import time

import numpy as np

from innerattn.envs import BatchEnv

BATCHES = (1, 32, 1024, 4096)
THREADS = (1, 2)
ROUNDS = 5
ROUND_S = 1.0


def env_steps_per_second(num_envs: int, num_threads: int) -> float:
    """Median over rounds of about a second each."""
    with BatchEnv("mixed", num_envs, seed=0, num_threads=num_threads) as env:
        env.reset()
        actions = np.random.default_rng(0).integers(0, 5, (64, num_envs, env.num_robots))
        count = 0
        rates = []
        for _ in range(ROUNDS + 1):
            start, begun = time.perf_counter(), count
            while time.perf_counter() - start < ROUND_S:
                env.step(actions[count % 64])
                count += 1
            rates.append((count - begun) * num_envs / (time.perf_counter() - start))
    return statistics.median(rates[1:])


def main() -> None:
    """Measure and print the table."""
    print(f"{platform.processor() or platform.machine()}, numpy {np.__version__}")
    print(f"{'worlds':>7} {'threads':>8} {'env-steps/s':>12} {'ratio':>6}")
    for num_envs in BATCHES:
        alone = 0.0
        for threads in THREADS:
            rate = env_steps_per_second(num_envs, threads)
            alone = alone or rate
            print(f"{num_envs:>7} {threads:>8} {rate:>12,.0f} {rate / alone:>6.2f}")


if __name__ == "__main__":
    main()
