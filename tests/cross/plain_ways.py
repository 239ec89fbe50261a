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
    return bool(are_clear(solids, radius, half, a, b[None])[0])


def are_clear(
    solids: list[tuple[Obstacle, Array]], radius: float, half: float, a: Array, ends: Array
) -> NDArray[np.bool_]:
    """Whether a disc touches nothing that drives straight from a to each of some ends (n, 2)."""
    longest = np.linalg.norm(ends - a, axis=1).max()
    along = np.linspace(np.broadcast_to(a, ends.shape), ends, max(2, int(longest / (0.1 * radius))))
    clear = (np.abs(along) <= half - radius + _LITTLE).all(axis=(0, 2))
    for solid, at in solids:
        clear &= (distance(solid, along - at) >= radius - _LITTLE).all(axis=0)
    return np.asarray(clear)


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
    rims = (place for solid, at in solids for place in rim(solid, at, radius))
    places = np.array([a, b, *rims])
    lengths = np.zeros((len(places), len(places)))
    for i, one in enumerate(places[1:], 1):
        before = places[:i]
        clear = are_clear(solids, radius, half, one, before)
        lengths[i, :i] = clear * np.linalg.norm(one - before, axis=1)
    return float(dijkstra(lengths, directed=False, indices=0)[1])
