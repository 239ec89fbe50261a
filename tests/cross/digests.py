"""What fourteen scenarios do, as digests that are kept beside the source.

`python tests/cross/digests.py` writes `digests.json` anew: it changes where the worlds change.
`rust_env/tests/worlds/digests.rs` does the same and compares the same numbers.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Arrival, Fault, Obstacle, Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.batch import FAULT_KINDS, Autoreset

FILE = Path(__file__).with_name("digests.json")
NUM_ENVS, STEPS, SEED = 6, 150, 20
AUTORESET: Autoreset = "same_step"


def scenarios() -> dict[str, Scenario]:
    """By name; with contacts in most steps, in every situation and engine."""
    tight = {"arena_half_width_m": 0.6, "spawn_clearance_m": 0.1, "contact_cost": 0.1}
    obstacles = (
        Obstacle(shape="disc", radius_m=0.12),
        Obstacle(shape="box", half_extents_m=(0.1, 0.04)),
        Obstacle(shape="box", half_extents_m=(0.04, 0.25), position_m=(-0.3, 0.2)),
    )
    mixed = Scenario.preset("mixed")
    faults = tuple(
        Fault(
            robot=robot.name,
            kind=kind,
            value=0.4,
            onset_step=2,
            onset_rate_hz=0.5,
            duration_steps=7,
        )
        for robot in mixed.robots
        for kind in FAULT_KINDS
    )
    plain = {name: Scenario.preset(name) for name in ("single", "double", "mixed", "mixed-16")}
    faulty = mixed.replace(faults=faults, observe_faults=True, **tight)
    continuous = mixed.replace(situation="double", actions="continuous", obstacles=obstacles)
    short = mixed.replace(shaping="potential", end_when_rescued=2, **tight)
    near = {**tight, "rescue_radius_m": 0.3, "episode_steps": 40}
    food, medicine = mixed.tasks
    served = food.replace(service_s=0.3, deadline_s=1.5)
    restarted = medicine.replace(service_s=0.2, service="restart", deadline_s=(0.5, 2.0))
    arriving = [
        Arrival(at_s=0.3 * index, task=("task_1", "task_2")[index % 2], position_m=(x, y))
        for index, (x, y) in enumerate((x, y) for x in (-0.3, 0.0, 0.3) for y in (-0.4, -0.1, 0.2))
    ]
    sites = (
        served.replace(area_m=(-0.4, -0.4, 0.0, 0.4)),
        restarted.replace(area_m=(0.1, -0.3, 0.4, 0.3), after=("task_1",)),
    )
    many = Scenario.preset("mixed-16").replace(observed_teammates=5, observed_victims=2)
    return {
        **plain,
        "tight": mixed.replace(**tight),
        "tight, discs": mixed.replace(engine="discs", **tight),
        "faults": faulty,
        "faults, discs": faulty.replace(engine="discs"),
        "continuous among obstacles": continuous,
        "short episodes, discs": short.replace(engine="discs"),
        "poisson, deadlines": mixed.replace(
            situation="poisson",
            lost_cost=0.5,
            tasks=(
                food.replace(deadline_s=1.0, arrival_rate_hz=0.6),
                medicine.replace(deadline_s=(0.5, 2.0), arrival_rate_hz=1.5),
            ),
            **near,
        ),
        "listed, services": mixed.replace(
            situation="listed",
            end_when_done=True,
            arrivals=arriving,
            lost_cost=0.2,
            tasks=(served, restarted),
            **near,
        ),
        "services, areas of tasks, discs": mixed.replace(engine="discs", tasks=sites, **near),
        "nearest teammates": many.replace(faults=faults, observe_faults=True),
    }


def actions(step: int, num_envs: int, num_robots: int) -> NDArray[np.int64]:
    """(E, R), 0 to 4: a fixed, irregular sequence."""
    env, robot = np.indices((num_envs, num_robots), np.uint64)
    mixed = np.uint64(step) * np.uint64(7919) + env * np.uint64(104_729)
    mixed = (mixed + robot * np.uint64(1_299_709)) * np.uint64(2_654_435_761)
    return ((mixed >> np.uint64(16)) % np.uint64(5)).astype(np.int64)


def drives(chosen: NDArray[np.int64]) -> NDArray[np.float32]:
    """(E, R, 2): the force of each action, for continuous actions."""
    table = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], np.float32)
    return table[chosen]


def shown(
    scenario: Scenario, threads: int = 1, num_envs: int = NUM_ENVS, first_env: int = 0
) -> list[list[bytes]]:
    """Of each step and world, the bytes of observations, rewards and flags."""
    with BatchEnv(
        scenario, num_envs, SEED, threads, autoreset=AUTORESET, first_env=first_env
    ) as env:
        env.reset()
        found = []
        for step in range(STEPS):
            chosen = actions(step, first_env + num_envs, env.num_robots)[first_env:]
            made = env.step(drives(chosen) if env.continuous else chosen)
            found.append(
                [
                    b"".join(
                        np.ascontiguousarray(part[world]).tobytes()
                        for part in (made.obs, made.reward, made.terminated, made.truncated)
                    )
                    for world in range(num_envs)
                ]
            )
    return found


def digest(steps: Iterable[Iterable[bytes]]) -> dict[str, Any]:
    """SHA-256 and CRC-32 of all bytes, step after step."""
    data = b"".join(b"".join(worlds) for worlds in steps)
    return {"sha256": hashlib.sha256(data).hexdigest(), "crc32": zlib.crc32(data)}


def main() -> None:
    """Write the file."""
    rows = [
        {"name": name, "scenario": one.model_dump(mode="json"), **digest(shown(one))}
        for name, one in scenarios().items()
    ]
    about = {"num_envs": NUM_ENVS, "steps": STEPS, "seed": SEED}
    FILE.write_text(f"{json.dumps({**about, 'rows': rows}, indent=1)}\n", "utf-8")


if __name__ == "__main__":
    main()
