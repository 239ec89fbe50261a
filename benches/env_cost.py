"""How the cost of a step grows with the batch, the robots, the victims, obstacles and threads.

`python benches/env_cost.py` varies one at a time around the default mixed scenario, fits a cost
model to all of it, draws `docs/images/env_cost.png` and fills its place in `docs/performance.md`.
Random discrete actions, Python call included; a larger team gets an arena of the same density.
"""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from page import machine, publish, table
from scipy.optimize import nnls

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

mpl.use("Agg")
from matplotlib import pyplot as plt

FIGURE = Path(__file__).parents[1] / "docs" / "images" / "env_cost.png"
ENGINES = ("rapier", "discs")
CORES = os.cpu_count() or 1
DEFAULT = {"batch": 1024, "robots": 4, "victims": 2, "obstacles": 0, "threads": CORES}
VARIED: dict[str, tuple[int, ...]] = {
    "batch": (1, 4, 16, 32, 64, 256, 1024, 4096, 16384, 65536),
    "robots": (1, 2, 4, 8, 16, 32, 64),
    "victims": (1, 2, 4, 8, 16, 32),
    "obstacles": (0, 1, 2, 4, 8, 16),
    "threads": tuple(range(1, 2 * CORES + 1)),
}
ROUNDS = 5
ROUND_S = 0.3
TERMS = ("call / batch", "world", "robots", "robots²", "robots × victims", "robots × obstacles")


def scenario(engine: str, robots: int, victims: int, obstacles: int) -> Scenario:
    """The default team repeated, in an arena that grows with it."""
    default = Scenario.preset("mixed").model_dump()
    team = [default["robots"][index % 4] | {"name": f"robot_{index}"} for index in range(robots)]
    tasks = [{"name": "task_1", "needs": ["food"]}] if robots < 4 else default["tasks"]
    return Scenario.model_validate(
        default
        | {
            "engine": engine,
            "robots": team,
            "tasks": tasks,
            "max_victims": victims,
            "arena_half_width_m": 0.5 * max(robots, 4) ** 0.5,
            "spawn_clearance_m": 0.1,
            "obstacles": [{"shape": "disc", "radius_m": 0.05}] * obstacles,
        }
    )


def microseconds(engine: str, case: dict[str, int]) -> float:
    """Time of an env-step, µs: median of rounds."""
    world = scenario(engine, case["robots"], case["victims"], case["obstacles"])
    threads = case["threads"]
    with BatchEnv(world, case["batch"], seed=0, num_threads=threads, copy=False) as env:
        env.reset()
        actions = np.random.default_rng(0).integers(0, 5, (16, case["batch"], case["robots"]))
        times = []
        count = 0
        for _ in range(ROUNDS + 1):
            start, before = time.perf_counter(), count
            while time.perf_counter() - start < ROUND_S:
                env.step(actions[count % 16])
                count += 1
            times.append((time.perf_counter() - start) / (count - before) / case["batch"])
        return 1e6 * statistics.median(times[1:])


def terms(case: dict[str, int]) -> list[float]:
    """The quantities whose multiples the model adds up, as `TERMS`."""
    robots = case["robots"]
    share = 1 / min(case["threads"], CORES)
    work = [1, robots, robots**2, robots * case["victims"], robots * case["obstacles"]]
    return [1 / case["batch"], *(share * amount for amount in work)]


def fit(cases: list[dict[str, int]], times: list[float]) -> tuple[list[float], float]:
    """Coefficients (µs, none negative) of least relative error, and its median size."""
    rows, wanted = np.array([terms(case) for case in cases]), np.array(times)
    weights, _ = nnls(rows / wanted[:, None], np.ones(len(wanted)))
    return weights.tolist(), float(np.median(abs(rows @ weights / wanted - 1)))


def draw(measured: dict[tuple[str, str], list[float]], models: dict[str, Any]) -> None:
    """One panel for each quantity varied; dots are measured, lines the model."""
    figure, axes = plt.subplots(
        1, len(VARIED), figsize=(15, 3.4), sharey=True, layout="constrained"
    )
    for axis, (name, values) in zip(axes, VARIED.items(), strict=True):
        for engine, colour in zip(ENGINES, ("tab:blue", "tab:orange"), strict=True):
            line = [np.dot(terms(DEFAULT | {name: value}), models[engine]) for value in values]
            x = [max(value, 0.5) for value in values]
            axis.plot(x, measured[engine, name], "o", color=colour, label=engine)
            axis.plot(x, line, color=colour, alpha=0.5)
        axis.set(xscale="log", yscale="log", xlabel=name if name != "batch" else "batch (worlds)")
        axis.set_xticks([max(value, 0.5) for value in values], [str(value) for value in values])
        axis.tick_params(axis="x", labelrotation=60, labelsize=8)
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("µs an env-step")
    axes[0].legend()
    figure.savefig(FIGURE, dpi=110)


def main() -> None:
    """Measure, fit, draw and publish."""
    measured: dict[tuple[str, str], list[float]] = {}
    models, errors = {}, {}
    for engine in ENGINES:
        cases = []
        for name, values in VARIED.items():
            chosen = [DEFAULT | {name: value} for value in values]
            measured[engine, name] = [microseconds(engine, case) for case in chosen]
            cases += chosen
        times = [value for name in VARIED for value in measured[engine, name]]
        models[engine], errors[engine] = fit(cases, times)
    draw(measured, models)
    parts = [f"{machine('numpy')}.", ""]
    for name, values in VARIED.items():
        head = [f"µs an env-step, {name}", *map(str, values)]
        rows = [[engine, *(f"{x:.2f}" for x in measured[engine, name])] for engine in ENGINES]
        parts += [table(head, rows), ""]
    rows = [
        [engine, *(f"{x:.3f}" for x in models[engine]), f"{100 * errors[engine]:.0f} %"]
        for engine in ENGINES
    ]
    parts += [
        "The model: µs of one core for each",
        "",
        table(["", *TERMS, "off by (median)"], rows),
    ]
    publish("env_cost", "\n".join(parts))


if __name__ == "__main__":
    main()
