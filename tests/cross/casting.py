"""What range sensors measure, in float64, every ray against every thing."""

from __future__ import annotations

from collections import Counter

import numpy as np
from stepper import Array, State, Stepper

from innerattn.config import Obstacle, Robot, Scenario

_SLACK_M = 1e-5
"""Things may be so much larger or smaller by rounding."""


def ray_columns(names: list[str]) -> list[int]:
    """The columns of an observation that rays fill."""
    return [column for column, name in enumerate(names) if name.startswith("own.ray.")]


def check_rays(plain: Stepper, state: State, found: Array) -> Counter[str]:
    """Hold readings (E, R, K) against the plain caster's; counts what was measured."""
    counts: Counter[str] = Counter()
    scenario, there = plain.scenario, plain.there(state)
    dark = ~there | (state.faults["blackout"] == 1)
    for own, robot in enumerate(scenario.robots):
        values = found[:, own]
        rays = robot.range_sensor.rays if robot.range_sensor else 0
        assert (values[:, rays:] == 0).all()
        if robot.range_sensor is None:
            continue
        least, most = (_readings(plain, state, own, gap) for gap in (-_SLACK_M, _SLACK_M))
        least, most = (np.where(dark[:, own, None], 0.0, one) for one in (least, most))
        grazes = most - least > 1e-3 + 20.0 * _SLACK_M / robot.range_sensor.range_m
        within = (least - 2e-5 <= values[:, :rays]) & (values[:, :rays] <= most + 2e-5)
        assert (within | grazes).all()
        counts["rays"] += values[:, :rays].size
        counts["met"] += int((most > 0).sum())
        counts["unsure of rays"] += int(grazes.sum())
    return counts


def _readings(plain: Stepper, state: State, own: int, gap: float) -> Array:
    """Readings of a robot (E, rays) where everything is larger by ``gap``."""
    scenario = plain.scenario
    robot = scenario.robots[own]
    sensor = robot.range_sensor
    assert sensor is not None
    seen = sensor.layers or (robot.layer,)
    start = state.positions[:, own, None]  # (E, 1, 2)
    angles = _angles(robot) + state.headings[:, own, None]
    direction = np.stack([np.cos(angles), np.sin(angles)], -1)  # (E, rays, 2)
    nearest = np.full(direction.shape[:2], sensor.range_m)
    there = plain.there(state)
    for other, mate in enumerate(scenario.robots):
        if other != own and mate.layer in seen:
            met = _disc(state.positions[:, other, None] - start, direction, mate.radius_m + gap)
            nearest = np.minimum(nearest, np.where(there[:, other, None], met, np.inf))
    for index, obstacle in enumerate(scenario.obstacles):
        if _blocks(obstacle, scenario, seen):
            way = state.obstacles[:, index, None] - start
            nearest = np.minimum(nearest, _obstacle(obstacle, way, direction, gap))
    with np.errstate(divide="ignore"):
        room = scenario.arena_half_width_m - gap - start * np.sign(direction)
        nearest = np.minimum(nearest, np.maximum(room / np.abs(direction), 0.0).min(-1))
    return np.asarray(1.0 - nearest / sensor.range_m)


def _blocks(obstacle: Obstacle, scenario: Scenario, seen: tuple[str, ...]) -> bool:
    layers = {robot.layer for robot in scenario.robots}
    return any(obstacle.blocks(layer) for layer in layers if layer in seen)


def _angles(robot: Robot) -> Array:
    sensor = robot.range_sensor
    assert sensor is not None
    half = np.radians(sensor.field_of_view_deg) / 2.0
    if sensor.field_of_view_deg == 360.0:
        return np.arange(sensor.rays) * 2.0 * np.pi / sensor.rays
    return np.zeros(1) if sensor.rays == 1 else np.linspace(-half, half, sensor.rays)


def _obstacle(obstacle: Obstacle, way: Array, direction: Array, gap: float) -> Array:
    if obstacle.radius_m is not None:
        return _disc(way, direction, obstacle.radius_m + gap)
    assert obstacle.half_extents_m is not None
    half = np.array(obstacle.half_extents_m) + gap
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(way - half) / direction, (way + half) / direction])
    enters, leaves = ends.min(0).max(-1), ends.max(0).min(-1)
    met = np.where((enters <= leaves) & (leaves >= 0.0), np.maximum(enters, 0.0), np.inf)
    return np.asarray(np.where((np.abs(way) <= half).all(-1), 0.0, met))


def _disc(way: Array, direction: Array, radius: float) -> Array:
    """The smaller root of |t · direction - way|² = radius², 0 from inside."""
    along = (way * direction).sum(-1)
    rest = (way * way).sum(-1) - radius**2
    root = along**2 - rest
    met = np.where((root >= 0.0) & (along > 0.0), along - np.sqrt(np.maximum(root, 0.0)), np.inf)
    return np.asarray(np.where(rest <= 0.0, 0.0, met))
