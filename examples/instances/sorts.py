"""Two sorts of problems of others as worlds, after the descriptions in their papers.

`python examples/instances/sorts.py fire -o fires.json` writes a file that `innerattn evaluate
hungarian --instances fires.json` takes. The papers say what robots and tasks are like; numbers and
sizes here are ours, so results are not to be compared with theirs.

- `fire`: robots carry amounts of water and have speeds of their own; a fire goes out when those
  beside it have as much water as it needs, together. Fu et al., "Capability-Aware Shared
  Hypernetworks for Flexible Heterogeneous Multi-Robot Coordination", CoRL 2025.
- `flood`: drones bring kits to victims, who can wait for different times; a part of the victims
  call later. A drone carries a few kits, flies a limited way, and goes back to the depot for both.
  Ghassemi and Chowdhury, "Multi-robot task allocation in disaster response: Addressing dynamic
  tasks with deadlines and robots with range and payload constraints", Robotics and Autonomous
  Systems 147, 2022.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from innerattn.config import Scenario
from innerattn.evaluate.instance_worlds import with_reference

HALF_M = 1.5


def fire(rng: np.random.Generator) -> Scenario:
    """Six robots and eight fires, of four sizes."""
    robots = [
        {
            "name": f"engine_{index}",
            "kind": "engine",
            "abilities": {"water": _value(rng, 0.5, 2.0)},
            "max_speed_mps": _value(rng, 0.5, 1.5),
            "mass_kg": 1.0,
            "start_m": place,
        }
        for index, place in enumerate(_apart(rng, 6))
    ]
    sizes = [{"name": f"size_{n}", "needs": {"water": 0.9 * (n + 1)}} for n in range(4)]
    fires = [
        {"at_s": 0.0, "task": f"size_{index % 4}", "position_m": place}
        for index, place in enumerate(_apart(rng, 8))
    ]
    return _world(robots=robots, tasks=sizes, arrivals=fires, max_victims=2)


def flood(rng: np.random.Generator) -> Scenario:
    """Five drones and thirty victims; three in ten call in the course of ten seconds."""
    base = (0.0, 0.0)
    drones = [
        {
            "name": f"drone_{index}",
            "kind": "drone",
            "abilities": ["kit"],
            "max_speed_mps": 1.5,
            "mass_kg": 0.5,
            "start_m": (0.15 * (index - 2), 0.0),
            "load": 4,
            "battery": {"capacity_j": 90.0, "per_m_j": 10.0},
        }
        for index in range(5)
    ]
    urgency = [
        {"name": f"urgency_{n}", "needs": ["kit"], "deadline_s": seconds}
        for n, seconds in enumerate((4.0, 8.0, 16.0, 32.0))
    ]
    called = np.where(rng.random(30) < 0.3, rng.uniform(0.0, 10.0, 30), 0.0).round(1)
    victims = [
        {"at_s": float(time), "task": f"urgency_{index % 4}", "position_m": place}
        for index, (time, place) in enumerate(zip(np.sort(called), _apart(rng, 30), strict=True))
    ]
    return _world(
        robots=drones,
        tasks=urgency,
        arrivals=victims,
        max_victims=8,
        stations=[{"position_m": base, "radius_m": 0.3, "recharge_w": 90.0}],
        depots=[{"position_m": base, "radius_m": 0.3}],
    )


SORTS: dict[str, Callable[[np.random.Generator], Scenario]] = {"fire": fire, "flood": flood}


def main() -> None:
    """Write a file of worlds of one sort."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sort", choices=SORTS)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    worlds = [
        with_reference(
            f"{given.sort}_{number}",
            given.sort,
            SORTS[given.sort](np.random.default_rng([given.seed, number])),
        )
        for number in range(given.count)
    ]
    given.output.write_text(json.dumps([one.written() for one in worlds], indent=1) + "\n")
    print(f"{given.output}: {given.count} worlds")


def _world(**values: Any) -> Scenario:
    common = {"situation": "listed", "end_when_done": True, "episode_steps": 1000}
    return Scenario().replace(**common, arena_half_width_m=HALF_M, **values)


def _value(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 2)


def _apart(rng: np.random.Generator, count: int) -> list[tuple[float, float]]:
    """Random places, each 0.2 m or more from all others."""
    places: list[tuple[float, float]] = []
    while len(places) < count:
        x, y = (round(float(one), 2) for one in rng.uniform(-HALF_M + 0.15, HALF_M - 0.15, 2))
        if all((x - a) ** 2 + (y - b) ** 2 >= 0.04 for a, b in places):
            places.append((x, y))
    return places


if __name__ == "__main__":
    main()
