"""No episode starts with an overlap, however narrow the arena."""

from typing import Any

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

BODY = {"max_speed_mps": 1.0, "mass_kg": 1.0}


def robots(*radii: float) -> list[dict[str, Any]]:
    kinds = ["food", "medicine", "information"]
    return [
        {"name": f"r{i}", "kind": f"k{i}", "abilities": [kinds[i % 3]], "radius_m": radius, **BODY}
        for i, radius in enumerate(radii)
    ]


NARROW = [
    {"arena_half_width_m": 0.2, "robots": robots(0.0535, 0.0999, 0.0535)},
    {"arena_half_width_m": 1.0, "robots": robots(0.48, 0.391, 0.1), "rescue_radius_m": 0.5},
]


@pytest.mark.parametrize("changes", NARROW, ids=["a fifth of a metre", "almost as large as that"])
def test_robots_start_apart(changes: dict[str, Any]) -> None:
    clearances = {"spawn_clearance_m": 0.0, "wall_clearance_m": 0.0}
    scenario = Scenario.preset("mixed").replace(**changes, **clearances)
    radii = np.array([robot.radius_m for robot in scenario.robots])
    env = BatchEnv(scenario, 4_000, seed=3)
    apart = radii[:, None] + radii + np.where(np.eye(len(radii)), -np.inf, 0.0)
    for _ in range(5):
        env.reset()
        places = env.positions()
        distances = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
        assert (distances >= apart).all()
        walls = scenario.arena_half_width_m - np.abs(places).max(axis=2)
        assert (walls >= radii).all()
