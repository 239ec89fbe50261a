"""Which places a robot sees at a moment: how far, within which angle, and what is in the way.

Faults of its senses are left out, as are those of teammates that tell it what they see.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario

_Places = NDArray[np.float64]


def sees_all(scenario: Scenario, robot: int) -> bool:
    """Whether nothing limits what a robot sees."""
    return not (scenario.occlusion or scenario.robots[robot].has_limited_sight)


def in_sight(
    scenario: Scenario,
    robot: int,
    own: NDArray[np.float32],
    heading: float,
    obstacles: NDArray[np.float32],
    places: NDArray[np.float32],
) -> NDArray[np.bool_]:
    """Which places a robot sees.

    Args:
        scenario: the world's description.
        robot: its index in the team.
        own: (2,) where it is [m].
        heading: where it points [rad]; of no account without a limited field of view.
        obstacles: (O, 2) obstacles' centres [m].
        places: (P, 2) [m].

    Returns:
        (P,) bool; a place of NaN is not seen.
    """
    seer, start = scenario.robots[robot], own.astype(np.float64)
    way = places.astype(np.float64) - start
    seen = np.asarray(~np.isnan(way).any(1))
    if seer.sight_m is not None:
        seen &= np.hypot(*way.T) <= seer.sight_m
    if seer.field_of_view_deg < 360.0:
        off = np.arctan2(way[:, 1], way[:, 0]) - heading
        off = np.abs(np.arctan2(np.sin(off), np.cos(off)))
        seen &= off <= np.radians(seer.field_of_view_deg) / 2.0
    if not scenario.occlusion:
        return seen
    shapes = [*zip(scenario.obstacles, obstacles.astype(np.float64), strict=True)]
    shapes += [(box, np.array(box.position_m)) for box in scenario.map_boxes]
    for shape, centre in shapes:
        if not shape.blocks(seer.layer):
            continue
        if shape.radius_m is not None:
            seen &= ~_crosses_disc(start - centre, way, shape.radius_m)
        else:
            seen &= ~_crosses_box(start - centre, way, np.array(shape.half_extents_m))
    return seen


def _crosses_disc(start: _Places, way: _Places, radius: float) -> NDArray[np.bool_]:
    """Whether ways (P, 2) from a place lead through a disc around the origin."""
    length = np.maximum((way * way).sum(1), 1e-12)
    share = np.clip(-(way @ start) / length, 0.0, 1.0)
    nearest = start + share[:, None] * way
    return np.asarray(np.hypot(*nearest.T) < radius)


def _crosses_box(start: _Places, way: _Places, half: _Places) -> NDArray[np.bool_]:
    """Whether ways (P, 2) from a place lead through a box around the origin."""
    middle, reach = start + way / 2.0, np.abs(way) / 2.0
    across = np.abs(middle[:, 0] * way[:, 1] - middle[:, 1] * way[:, 0])
    apart = np.abs(middle) >= half + reach  # on one of the axes, or across the way
    parted = across >= half[0] * np.abs(way[:, 1]) + half[1] * np.abs(way[:, 0])
    return np.asarray(~(apart.any(1) | parted))
