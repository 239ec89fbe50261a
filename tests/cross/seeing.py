"""Who sees whom, in float64 and by other formulas than the compiled worlds'."""

from __future__ import annotations

from collections import Counter

import numpy as np
from hearing import told
from numpy.typing import NDArray
from stepper import Array, Bools, State, Stepper

_SLACK_M = 1e-5
"""Distances that differ by less may be decided by rounding."""


def check_sight(plain: Stepper, before: State, after: State) -> Counter[str]:
    """Hold what robots last saw after a step against what they can see; counts what was seen."""
    seen, unsure, hidden = in_sight(plain, after)
    robots = len(plain.scenario.robots)
    news = told(plain, after, seen[..., robots:])
    if news.any():  # who is unsure may tell
        unsure[..., robots:] |= unsure[..., robots:].any(1, keepdims=True)
    own, seen = seen, seen.copy()
    seen[..., robots:] |= news
    stays = after.victims["id"] == before.victims["id"]
    stays = np.concatenate([np.ones(after.positions.shape[:2], bool), stays], 1)[:, None]
    kept = np.where(stays, before.last_seen, -1)
    wanted = np.where(seen, after.steps[:, None, None], kept)
    assert (after.last_seen == wanted)[~unsure].all()
    there = np.concatenate([plain.there(after), after.present], 1)[:, None]
    return Counter(
        {
            "in sight": int(own.sum()),
            "told": int((seen & ~own).sum()),
            "out of sight": int((~seen & there).sum()),
            "remembered": int((~seen & (after.last_seen >= 0)).sum()),
            "hidden": int(hidden.sum()),
            "unsure of sight": int(unsure.sum()),
        }
    )


def in_sight(plain: Stepper, state: State) -> tuple[Bools, Bools, Bools]:
    """What each robot sees of robots and victims, where rounding might decide, and what is near
    enough but hidden, each (E, R, R + V)."""
    places = np.concatenate([state.positions, state.places], 1)
    distance = np.linalg.norm(places[:, None] - state.positions[:, :, None], axis=-1)
    robots = len(plain.scenario.robots)
    limits = [robot.sight_m for robot in plain.scenario.robots]
    limit = np.array([np.inf if one is None else one for one in limits])[:, None]
    there = plain.there(state)
    looks = there & (state.faults["blackout"] == 0)
    could = looks[:, :, None] & np.concatenate([there, state.present], 1)[:, None]
    could[:, :, :robots] &= ~np.eye(robots, dtype=bool)
    could[:, :, :robots] &= (state.faults["lost_communication"] == 0)[..., None]
    ahead = _angle_from_ahead(state, places)
    fields = np.radians([robot.field_of_view_deg for robot in plain.scenario.robots])[:, None]
    edge = np.where(fields < 2.0 * np.pi - 1e-9, 0.5 * fields, 4.0)  # beyond all angles
    near = (distance <= limit) & (ahead <= edge)
    hidden = _hidden(plain, state, places, 0.0)
    far, close = (
        (distance <= limit - gap)
        & ((ahead - edge) * distance <= -gap)
        & ~_hidden(plain, state, places, gap)
        for gap in (-_SLACK_M, _SLACK_M)
    )
    return could & near & ~hidden, could & (far != close), could & near & hidden


def _angle_from_ahead(state: State, places: Array) -> Array:
    """How far from its heading each robot has places (E, P, 2), (E, R, P)."""
    way = places[:, None] - state.positions[:, :, None]
    off = np.arctan2(way[..., 1], way[..., 0]) - state.headings[..., None]
    return np.abs(np.angle(np.exp(1j * off)))


def _hidden(plain: Stepper, state: State, places: Array, gap: float) -> Bools:
    """Places (E, P, 2) to which the straight way from a robot is nearer than ``gap`` to the inside
    of an obstacle of its layer, (E, R, P)."""
    found = np.zeros((*state.positions.shape[:2], places.shape[1]), bool)
    if not plain.scenario.occlusion:
        return found
    for index, obstacle in enumerate(plain.scenario.obstacles):
        centre = state.obstacles[:, index, None, None]
        start = state.positions[:, :, None] - centre
        way = places[:, None] - state.positions[:, :, None]
        if obstacle.radius_m is not None:
            crossed = _crosses_disc(start, way, obstacle.radius_m + gap)
        else:
            assert obstacle.half_extents_m is not None
            crossed = _crosses_box(start, way, np.array(obstacle.half_extents_m) + gap)
        blocks = np.array([obstacle.blocks(layer) for layer in plain.layers.tolist()])
        found |= crossed & blocks[:, None]
    return found


def _crosses_disc(start: Array, way: Array, radius: float) -> Bools:
    """Whether the quadratic equation of the rim has a root on the way, or all of it is inside."""
    a, b = (way * way).sum(-1), 2.0 * (start * way).sum(-1)
    c = (start * start).sum(-1) - radius * radius
    root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    a = np.where(a > 0.0, a, 1.0)
    first, last = (-b - root) / (2.0 * a), (-b + root) / (2.0 * a)
    crosses = (b * b - 4.0 * a * c > 0.0) & (first < 1.0) & (last > 0.0)
    return np.asarray(crosses & (way != 0.0).any(-1))


def _crosses_box(start: Array, way: Array, half: NDArray[np.float64]) -> Bools:
    """Whether some of the way is between both pairs of sides (Liang & Barsky 1984)."""
    shape = np.broadcast_shapes(start.shape, way.shape)
    start, way = np.broadcast_to(start, shape), np.broadcast_to(way, shape)
    along = np.where(way == 0.0, 1e-300, way)
    ends = np.stack([(-half - start) / along, (half - start) / along])
    enters, leaves = ends.min(0).max(-1), ends.max(0).min(-1)
    return np.asarray(np.maximum(enters, 0.0) < np.minimum(leaves, 1.0)) & (way != 0.0).any(-1)
