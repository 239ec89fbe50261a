"""Shortest ways of a disc around solids, by a graph of all places that see each other.

Nothing here is a grid: the places are around each solid, as near as the disc can be.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from innerattn.config.scenario import Obstacle

Array = NDArray[np.float64]
_TURN = math.radians(10.0)
_LITTLE = 1e-6


def distance(solid: Obstacle, at: Array) -> Array:
    """Distances of places (..., 2), from the solid's centre, to its surface; 0 inside [m]."""
    if solid.shape == "disc":
        assert solid.radius_m is not None
        return np.maximum(np.hypot(at[..., 0], at[..., 1]) - solid.radius_m, 0.0)
    assert solid.half_extents_m is not None
    beyond = np.maximum(np.abs(at) - np.array(solid.half_extents_m), 0.0)
    return np.hypot(beyond[..., 0], beyond[..., 1])


def is_clear(
    solids: list[tuple[Obstacle, Array]], radius: float, half: float, a: Array, b: Array
) -> bool:
    """Whether a disc that drives straight from a to b touches nothing."""
    along = np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / (0.1 * radius))))
    if np.abs(along).max() > half - radius + _LITTLE:
        return False
    return all((distance(solid, along - at) >= radius - _LITTLE).all() for solid, at in solids)


def rim(solid: Obstacle, at: Array, radius: float) -> list[Array]:
    """Places at which a disc just does not touch a solid, where ways may turn."""
    # Ways between them stay clear: they are on the outer side of the rounding.
    out = (radius + _LITTLE) / math.cos(_TURN / 2)
    if solid.shape == "disc":
        assert solid.radius_m is not None
        out = (solid.radius_m + radius + _LITTLE) / math.cos(_TURN / 2)
        angles = np.arange(0.0, 2 * math.pi, _TURN)
        return [at + out * np.array([math.cos(angle), math.sin(angle)]) for angle in angles]
    assert solid.half_extents_m is not None
    quarter = [(math.cos(angle), math.sin(angle)) for angle in np.linspace(0.0, math.pi / 2, 10)]
    return [
        at + np.array([x, y]) * (np.array(solid.half_extents_m) + out * np.array(turn))
        for x in (-1, 1)
        for y in (-1, 1)
        for turn in quarter
    ]


def shortest(
    solids: list[tuple[Obstacle, Array]], radius: float, half: float, a: Array, b: Array
) -> float:
    """Length of the shortest way of a disc from a to b [m]; infinite if there is none."""
    places = [a, b, *(place for solid, at in solids for place in rim(solid, at, radius))]
    lengths = np.zeros((len(places), len(places)))
    for i, one in enumerate(places):
        for j in range(i):
            if is_clear(solids, radius, half, one, places[j]):
                lengths[i, j] = np.linalg.norm(one - places[j])
    return float(dijkstra(lengths, directed=False, indices=0)[1])
