"""How fast several workers train, what their exchange costs, and up to how many it pays.

`python benches/worker_speed.py` trains the preset `mixed` with the budget `fast`, with one worker
and with one for each core in turn, three times, and times the exchange of gradients beside gloo's
`all_reduce` in the same run. The model reads update times of one worker, for the rows that each of
several would have.

With `--any-team` it trains a policy for any team (`innerattn train --family any`) instead, and
nothing else.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from mmap import mmap
from pathlib import Path
from socket import socket, socketpair

import torch
import torch.distributed as dist
from page import machine, publish, table
from torch import Tensor

from innerattn.config import RunConfig, load_run_config
from innerattn.config.streams import stream_seed
from innerattn.cores import usable_cores
from innerattn.envs import BatchEnv
from innerattn.train.build import keep_heap_small, torch_threads
from innerattn.train.matmul_backend import chosen_matmul_backend
from innerattn.train.parts import Parts
from innerattn.train.workers.exchange import Exchange, memory_bytes

PAGE = Path(__file__).parents[1] / "docs" / "scale.md"
METHODS = {"mappo": 1_500_000, "ppo-inner": 1_500_000, "td-inner": 40_000}
"""Env-steps that are trained, by method."""
ANY_TEAM = {"team-inner": 128_000}
"""The same of policies for any team: five rollouts."""
SIZES = (10, 1_000, 10_000, 30_000, 100_000, 1_000_000)
WORKERS = (1, 2, 4, 8, 16, 32)
ROUNDS = 3
TIMES = 300
NETWORK_US = 100.0
"""Time of a message between two machines that the model assumes [us]."""


def trained(method: str, workers: int, folder: Path) -> tuple[float, float]:
    """Env-steps/s of the second half of a training, and seconds of the whole command."""
    run = folder / f"{method}-{workers}-{time.monotonic_ns()}"
    begun = time.monotonic()
    env_steps = (METHODS | ANY_TEAM)[method]
    options = {
        "--method": method,
        "--budget": "fast",
        "--train.workers": str(workers),
        "--train.threads": "1",
        "--train.env-steps": str(env_steps),
        "--train.log-every-env-steps": str(env_steps // 20),
        "--evaluate.score-episodes": "100",
        "--run-dir": str(run),
    }
    options |= {"--family": "any"} if method in ANY_TEAM else {"--train.compile": "on"}
    words = [word for pair in options.items() for word in pair]
    subprocess.run([sys.executable, "-m", "innerattn", "train", "--quiet", *words], check=True)
    seconds = time.monotonic() - begun
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    middle = len(lines) // 2
    steps = lines[-1]["env_steps"] - lines[middle]["env_steps"]
    return steps / (lines[-1]["seconds"] - lines[middle]["seconds"]), seconds


def speed_table(methods: Mapping[str, int], most: int) -> str:
    """Training with one worker and with several, in turn."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for method, env_steps in methods.items():
            found: dict[int, list[tuple[float, float]]] = {1: [], most: []}
            for _ in range(ROUNDS):
                for workers in found:
                    found[workers].append(trained(method, workers, Path(folder)))
            ratios = [many[0] / one[0] for one, many in zip(found[1], found[most], strict=True)]
            for workers, results in found.items():
                rates, seconds = zip(*results, strict=True)
                share = "" if workers == 1 else _listed(ratios, ".2f")
                name = f"{method}, {env_steps:,} env-steps"
                rows.append(
                    (name, str(workers), _listed(rates, ",.0f"), share, _listed(seconds, ".0f"))
                )
    head = ("training", "workers", "env-steps/s", "times one worker", "whole command, s")
    return table(head, rows)


def _listed(values: Sequence[float], form: str) -> str:
    others = ", ".join(format(value, form) for value in values)
    return f"{format(statistics.median(values), form)} ({others})"


def _median_us(exchange: Callable[[Tensor], object], values: Tensor) -> float:
    """Time of one exchange, median of many [us]."""
    times = []
    for _ in range(TIMES):
        begun = time.perf_counter()
        exchange(values)
        times.append(time.perf_counter() - begun)
    return statistics.median(times[TIMES // 10 :]) * 1e6


def _exchange_in(
    rank: int, count: int, memory: mmap, sockets: Sequence[socket], store: str, found: str
) -> None:
    """One process of the comparison; the first writes what it found."""
    torch.set_num_threads(1)
    os.environ.setdefault("GLOO_SOCKET_IFNAME", "lo")
    ours = Exchange(rank, count, memory, sockets)
    dist.init_process_group("gloo", store=dist.FileStore(store, count), rank=rank, world_size=count)
    rows = []
    for size in SIZES:
        values = torch.full((size,), float(rank))
        own = _median_us(lambda some: ours.gather(some).mean(dim=0), values)
        gloo = _median_us(dist.all_reduce, values)
        rows.append([size, own, gloo])
    dist.destroy_process_group()
    if rank == 0:
        Path(found).write_text(json.dumps(rows))


def exchange_times(count: int) -> list[tuple[int, float, float]]:
    """Size, time of an exchange and of gloo's [us], between processes of this machine."""
    with tempfile.TemporaryDirectory() as folder:
        found, store = f"{folder}/found", f"{folder}/store"
        memory = mmap(-1, memory_bytes(count))  # forked processes share it
        pairs = [socketpair() for _ in range(1, count)]
        context = multiprocessing.get_context("fork")
        processes = []
        for rank in range(count):
            own = [pairs[rank - 1][1]] if rank else [one for one, _ in pairs]
            arguments = (rank, count, memory, own, store, found)
            processes.append(context.Process(target=_exchange_in, args=arguments))
        for process in processes:
            process.start()
        for process in processes:
            process.join()
        return [tuple(row) for row in json.loads(Path(found).read_text())]


def _config(method: str, rows: int, worlds: int) -> RunConfig:
    size = "td.batch_size" if method.startswith("td") else "ppo.minibatch_size"
    values = {"train.method": method, size: rows, "train.num_envs": worlds}
    return load_run_config("mixed", budget="fast", overrides=values)


def step_and_update(method: str, workers: int) -> tuple[float, float, float]:
    """Of one worker among several: control step [s], update [s], and control steps an update."""
    base = load_run_config("mixed", budget="fast", overrides={"train.method": method})
    rows = max(1, base.algorithm.rows_per_update // workers)
    worlds = max(1, base.train.num_envs // workers)
    config = _config(method, rows, worlds)
    with torch_threads(1), chosen_matmul_backend("auto"):
        env = BatchEnv(
            config.training_scenario,
            worlds,
            seed=stream_seed(0, "training"),
            num_threads=1,
            copy=False,
        )
        with closing(env):
            torch.compiler.reset()
            parts = Parts(config, env, "training")
            parts.learner.compile()
            stepping = learning = 0.0
            steps, first, updates = 0, 0, 0
            enough = 100 if method.startswith("ppo") or method == "mappo" else 40
            while updates < enough + 20:
                begun = time.perf_counter()
                parts.schedule.set_progress(0.5)
                transitions, truncated = parts.collector.step()
                parts.learner.observe(transitions, truncated)
                middle = time.perf_counter()
                parts.learner.learn()
                end = time.perf_counter()
                updates = parts.learner.updates
                if updates >= 20:
                    if not first:
                        first = updates
                        continue
                    stepping += middle - begun
                    learning += end - middle
                    steps += 1
    done = updates - first
    return stepping / steps, learning / done, steps / done


def model_table(exchange_us: float) -> str:
    """What the model expects of more workers, on one machine and over a network."""
    rows = []
    for method in ("mappo", "ppo-inner"):
        base = load_run_config("mixed", budget="fast", overrides={"train.method": method})
        worlds = base.train.num_envs
        for place, message in (("one machine", exchange_us), ("network", NETWORK_US)):
            cells = []
            alone = 0.0
            for workers in WORKERS:
                step, update, steps = _measured(method, workers)
                waiting = 0.0 if workers == 1 else message * 1e-6 * (1 + 0.1 * (workers - 2))
                speed = worlds * steps / (step * steps + update + waiting)
                alone = alone or speed
                cells.append(f"{speed:,.0f} ({speed / alone:.1f}x)")
            rows.append((f"{method}, {place}", *cells))
    return table(("env-steps/s expected with", *map(str, WORKERS)), rows)


_known: dict[tuple[str, int], tuple[float, float, float]] = {}


def _measured(method: str, workers: int) -> tuple[float, float, float]:
    if (method, workers) not in _known:
        found = [step_and_update(method, workers) for _ in range(ROUNDS)]
        _known[method, workers] = sorted(found, key=lambda one: one[1])[ROUNDS // 2]
    return _known[method, workers]


def main() -> None:
    """Measure, print, and fill the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--any-team", action="store_true", help="train a policy for any team alone")
    most = usable_cores()
    if parser.parse_args().any_team:
        text = f"{machine('torch')}.\n\n{speed_table(ANY_TEAM, most)}"
        publish("any_team_speed", text, PAGE)
        return
    keep_heap_small()
    times = exchange_times(most)
    exchange = table(
        ("float32 numbers", "shared memory, µs", "gloo, µs", "ratio"),
        [
            (f"{size:,}", f"{own:,.0f}", f"{gloo:,.0f}", f"{gloo / own:.1f}x")
            for size, own, gloo in times
        ],
    )
    of_gradients = next(own for size, own, _ in times if size >= 30_000)
    text = "\n\n".join(
        [
            f"{machine('torch')}.",
            speed_table(METHODS, most),
            f"Exchanges of {most} workers:",
            exchange,
            model_table(of_gradients),
        ]
    )
    publish("worker_speed", text, PAGE)


if __name__ == "__main__":
    main()
