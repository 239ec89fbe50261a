"""Where robots can drive between walls and what stands at a place of its own, on a grid."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Obstacle, Robot, Scenario, Task

_CELLS = 201
_LEAST_SHARE = 0.01
"""Smaller parts of an area are within the error of the grid."""

Mask = NDArray[np.bool_]


def closed_off(scenario: Scenario) -> Iterator[str]:
    """What obstacles keep from every robot that a task needs, a sentence each.

    Robots with a start can drive where their start is connected to; others may start anywhere. A
    place counts as closed only if it is so by more than a cell of the grid, a hundredth of
    ``arena_half_width_m``.
    """
    if scenario.map is None and all(one.position_m is None for one in scenario.obstacles):
        return
    needs = dict.fromkeys(need for task in scenario.tasks for need in task.needs)
    for need in needs:
        able = [robot for robot in scenario.robots if need in robot.abilities]
        near = np.any([_near(scenario, robot) for robot in able], axis=0)
        asking = [task for task in scenario.tasks if need in task.needs]
        for x, y in _places(scenario, asking):
            if not near[_cell(scenario, x, y)]:
                yield f"place ({x:g}, {y:g}): obstacles keep every robot with {need} away from it"
        for task in () if scenario.only_places_m else _unlike(asking):
            area = _area(scenario, task)
            share = float((area & ~near).sum() / max(1, area.sum()))
            if share > _LEAST_SHARE:
                whose = "victims" if task.area_m is None else f"victims of {task.name}"
                yield (
                    f"{whose}: obstacles keep every robot with {need} away from "
                    f"{100.0 * share:.0f} % of their area"
                )


def _places(scenario: Scenario, tasks: list[Task]) -> Iterable[tuple[float, float]]:
    """The listed places at which victims of these tasks appear [m], each once."""
    names = {task.name for task in tasks}
    arriving = (one.position_m for one in scenario.arrivals if one.task in names)
    listed = (at for at in scenario.victim_places_m if any(task.holds(*at) for task in tasks))
    return dict.fromkeys(arriving if scenario.arrivals else listed)


def _unlike(tasks: list[Task]) -> Iterator[Task]:
    """Tasks with an area of their own, and one of those without."""
    plain = [task for task in tasks if task.area_m is None]
    yield from plain[:1]
    yield from (task for task in tasks if task.area_m is not None)


def _near(scenario: Scenario, robot: Robot) -> Mask:
    """Cells from which a place is within reach of where a robot can drive."""
    from scipy.ndimage import distance_transform_edt, label

    x, y = _grid(scenario)
    step = _step(scenario)
    radius = robot.radius_m - step
    half = scenario.arena_half_width_m
    inside = np.maximum(np.abs(x), np.abs(y)) <= half - radius
    solids = (*scenario.obstacles, *scenario.map_boxes)
    blocking = [one for one in solids if one.blocks(robot.layer)]
    free = inside & (_clearance(blocking, x, y) >= radius)
    if robot.start_m is not None:
        parts, _ = label(free, np.ones((3, 3)))
        free = free & (parts == parts[_cell(scenario, *robot.start_m)])
    if not free.any():
        return free
    away = distance_transform_edt(~free) * step
    return np.asarray(away <= scenario.rescue_radius_m + step)


def _area(scenario: Scenario, task: Task) -> Mask:
    """Cells where victims of a task may appear."""
    x, y = _grid(scenario)
    x_min, y_min, x_max, y_max = scenario.area_of(task)
    inside = (x_min <= x) & (x <= x_max) & (y_min <= y) & (y <= y_max)
    return inside & (_clearance((*scenario.obstacles, *scenario.map_boxes), x, y) > 0.0)


def _clearance(
    obstacles: Iterable[Obstacle], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance to the nearest obstacle that has a place, below 0 inside one [m]."""
    nearest = np.full(x.shape, math.inf)
    for one in obstacles:
        if one.position_m is None:
            continue
        dx, dy = np.abs(x - one.position_m[0]), np.abs(y - one.position_m[1])
        if one.radius_m is not None:
            found = np.hypot(dx, dy) - one.radius_m
        else:
            assert one.half_extents_m is not None  # a box
            px, py = dx - one.half_extents_m[0], dy - one.half_extents_m[1]
            outside = np.hypot(np.maximum(px, 0.0), np.maximum(py, 0.0))
            found = outside + np.minimum(np.maximum(px, py), 0.0)
        nearest = np.minimum(nearest, found)
    return nearest


def _grid(scenario: Scenario) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    half = scenario.arena_half_width_m
    ticks = np.linspace(-half, half, _CELLS)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    return x, y


def _step(scenario: Scenario) -> float:
    return 2.0 * scenario.arena_half_width_m / (_CELLS - 1)


def _cell(scenario: Scenario, x: float, y: float) -> tuple[int, int]:
    half, step = scenario.arena_half_width_m, _step(scenario)
    return round((x + half) / step), round((y + half) / step)
