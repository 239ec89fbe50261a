"""Range sensors: env-steps a second of 16 robots with and without 32 rays each, beside VMAS.

`python benches/ray_speed.py` fills its place in `docs/performance.md`. One core, 64 worlds, random
discrete actions, Python call included. VMAS plays its own "navigation" with as many agents and
rays of the same range, and is measured where it is installed (extra `peers`).
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from contestants import installed
from page import machine, publish, table

from innerattn.config import RangeSensor, Scenario
from innerattn.envs import BatchEnv

ROBOTS, RAYS, RANGE_M = 16, 32, 1.0
ENVS = 64
ROUNDS = 5
ROUND_S = 2.0
ACTIONS = np.random.default_rng(0).integers(0, 5, (16, ENVS, ROBOTS))


def scenario(engine: str, rays: int) -> Scenario:
    """Sixteen mixed robots in an arena of 4 x 4 m, with so many rays each."""
    team = Scenario().robots
    sensor = RangeSensor(rays=rays, range_m=RANGE_M) if rays else None
    robots = tuple(
        team[index % 4].replace(name=f"robot_{index}", range_sensor=sensor)
        for index in range(ROBOTS)
    )
    return Scenario(robots=robots, engine=engine, arena_half_width_m=2.0, episode_steps=100)


def ours(engine: str, rays: int) -> Callable[[int], object]:
    """What does a step of our worlds, by its number."""
    env = BatchEnv(scenario(engine, rays), ENVS, seed=0, num_threads=1, copy=False)
    env.reset()
    return lambda step: env.step(ACTIONS[step % len(ACTIONS)])


def vmas(rays: int) -> Callable[[int], object]:
    """What does a step of VMAS's navigation, by its number."""
    import torch
    from vmas import make_env

    torch.set_num_threads(1)
    lidar = {"n_lidar_rays": rays, "lidar_range": RANGE_M} if rays else {"collisions": False}
    env: Any = make_env(
        "navigation",
        ENVS,
        device="cpu",
        continuous_actions=False,
        seed=0,
        n_agents=ROBOTS,
        world_spawning_x=2.0,
        world_spawning_y=2.0,
        **lidar,
    )
    env.reset()
    columns = torch.from_numpy(ACTIONS)
    actions = [[row[:, agent, None] for agent in range(ROBOTS)] for row in columns]
    return lambda step: env.step(list(actions[step % len(actions)]))


def rate(act: Callable[[int], object]) -> float:
    """Env-steps a second, the median of rounds after one that is not counted."""
    rates, step = [], 0
    for _ in range(ROUNDS + 1):
        begun, before = time.perf_counter(), step
        while time.perf_counter() - begun < ROUND_S:
            act(step)
            step += 1
        rates.append((step - before) * ENVS / (time.perf_counter() - begun))
    return statistics.median(rates[1:])


def main() -> None:
    """Measure and publish."""
    contestants: dict[str, Callable[[int], Callable[[int], object]]] = {
        f"innerattn, {engine}": lambda rays, engine=engine: ours(engine, rays)  # type: ignore[misc]
        for engine in ("discs", "rapier")
    }
    packages = ["numpy"]
    if installed("vmas"):
        contestants["VMAS navigation"] = vmas
        packages += ["torch", "vmas"]
    found = {name: [rate(make(rays)) for rays in (0, RAYS)] for name, make in contestants.items()}
    peer = found.get("VMAS navigation", [float("nan")] * 2)[1]
    rows = [
        [name, f"{without:,.0f}", f"{with_rays:,.0f}", f"{with_rays / peer:,.0f}"]
        for name, (without, with_rays) in found.items()
    ]
    head = [f"env-steps/s of {ROBOTS} robots", "no rays", f"{RAYS} rays each", "of VMAS's"]
    publish("ray_speed", f"{machine(*packages)}.\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
