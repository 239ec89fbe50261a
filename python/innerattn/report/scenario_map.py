"""A scenario as a map of characters, for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator

from innerattn.config import Map, Obstacle, Scenario
from innerattn.config.amounts import in_words

_COLUMNS, _ROWS = 61, 31
_MOST_ROWS, _MOST_COLUMNS = 40, 76
_CORNER, _SIDE, _UPRIGHT = "+", "-", "|"
_FREE, _AREA, _PLACE, _SOLID, _PASSED = " ", "·", "x", "#", "%"


def scenario_map(scenario: Scenario) -> str:
    """The arena with all that has a place of its own, and a legend; without a newline at the end.

    Robots with a start are drawn by a letter, obstacles by ``#``, those that some layers pass by
    ``%``, victims' places by ``x``, and the areas in which victims may appear by ``·``.
    """
    half = scenario.arena_half_width_m
    wall = _CORNER + _SIDE * _COLUMNS + _CORNER
    lines = [wall]
    starts = {
        (_column(at[0], half), _row(at[1], half)): letter
        for letter, at in zip(_letters(), _starts(scenario), strict=False)
    }
    listed = scenario.only_places_m
    places = {(_column(x, half), _row(y, half)) for x, y in listed}
    areas = set() if listed else {scenario.area_of(task) for task in scenario.tasks}
    for row in range(_ROWS):
        y = half * (1.0 - 2.0 * (row + 0.5) / _ROWS)
        cells = []
        for column in range(_COLUMNS):
            x = half * (2.0 * (column + 0.5) / _COLUMNS - 1.0)
            if letter := starts.get((column, row)):
                cells.append(letter)
            elif over := _over(scenario, column, row, x, y):
                cells.append(_SOLID if any(_blocks_all(scenario, one) for one in over) else _PASSED)
            elif (column, row) in places:
                cells.append(_PLACE)
            else:
                cells.append(_AREA if any(_holds(area, x, y) for area in areas) else _FREE)
        lines.append(_UPRIGHT + "".join(cells) + _UPRIGHT)
    return "\n".join([*lines, wall, *_legend(scenario)])


def map_for_screen(found: Map) -> str | None:
    """A map whose rows fill more than a screen, with several cells in one; None: it fits as it is.

    At most 40 rows of 76 signs: ``#`` where one of the cells is solid, else ``.``; a sentence above
    says how many there are. Without a newline at the end.
    """
    side = len(found.rows)
    if side <= _MOST_ROWS:
        return None
    columns = [
        _cells(one, min(side, _MOST_COLUMNS), side) for one in range(min(side, _MOST_COLUMNS))
    ]
    lines = []
    for row in range(_MOST_ROWS):
        solid = found.solid[_cells(row, _MOST_ROWS, side)]
        lines.append("".join("#" if solid[:, cells].any() else "." for cells in columns))
    said = f"{side} rows of {side} cells, joined to {_MOST_ROWS} of {len(columns)} for the screen:"
    return "\n".join([said, *lines])


def _legend(scenario: Scenario) -> Iterator[str]:
    yield f"{scenario.arena_half_width_m * 2:g} m from wall to wall"
    placed = [robot for robot in scenario.robots if robot.start_m is not None]
    for letter, robot in zip(_letters(), placed, strict=False):
        offers = ", ".join(in_words(robot.abilities)) or "no ability"
        offers += f"; layer {robot.layer}" * (len(scenario.layers) > 1)
        yield f"{letter}  {robot.name} starts here ({offers})"
    if scenario.only_places_m:
        yield f"{_PLACE}  a victim may appear here"
    else:
        yield f"{_AREA}  victims appear here"
    drawn: list[Obstacle | Map] = [one for one in scenario.obstacles if one.position_m is not None]
    if scenario.map is not None:
        drawn.append(scenario.map)
    if any(_blocks_all(scenario, one) for one in drawn):
        yield f"{_SOLID}  an obstacle or a solid cell" if scenario.map else f"{_SOLID}  an obstacle"
    if not all(_blocks_all(scenario, one) for one in drawn):
        yield f"{_PASSED}  an obstacle that robots of some layers pass"
    robots = len(scenario.robots) - len(placed)
    obstacles = sum(obstacle.position_m is None for obstacle in scenario.obstacles)
    anywhere = ((robots, "robot"), (obstacles, "obstacle"))
    if robots or obstacles:
        shown = [f"{count} {what}{'s' * (count != 1)}" for count, what in anywhere if count]
        yield f"At new random places in each episode: {', '.join(shown)}"


def _over(scenario: Scenario, column: int, row: int, x: float, y: float) -> list[Obstacle | Map]:
    """What stands at the centre of a character, or the map if one of its cells there is solid."""
    over: list[Obstacle | Map] = [one for one in scenario.obstacles if _covers(one, x, y)]
    if scenario.map is not None:
        side = len(scenario.map.rows)
        rows, columns = _cells(row, _ROWS, side), _cells(column, _COLUMNS, side)
        if scenario.map.solid[rows, columns].any():
            over.append(scenario.map)
    return over


def _cells(index: int, count: int, side: int) -> slice:
    """The cells of a map under one of ``count`` characters: those whose centre is there, or one."""
    first = math.ceil(index / count * side - 0.5)
    return slice(first, max(first + 1, math.ceil((index + 1) / count * side - 0.5)))


def _letters() -> Iterator[str]:
    """A letter for each robot with a start; after them an asterisk for all others."""
    yield from "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwyz"
    while True:
        yield "*"


def _starts(scenario: Scenario) -> list[tuple[float, float]]:
    return [robot.start_m for robot in scenario.robots if robot.start_m is not None]


def _column(x: float, half: float) -> int:
    return min(int((x / half + 1.0) / 2.0 * _COLUMNS), _COLUMNS - 1)


def _row(y: float, half: float) -> int:
    return min(int((1.0 - y / half) / 2.0 * _ROWS), _ROWS - 1)


def _blocks_all(scenario: Scenario, obstacle: Obstacle | Map) -> bool:
    return all(map(obstacle.blocks, scenario.layers))


def _covers(obstacle: Obstacle, x: float, y: float) -> bool:
    """Whether an obstacle with a place lies over a point."""
    if obstacle.position_m is None:
        return False
    dx, dy = x - obstacle.position_m[0], y - obstacle.position_m[1]
    if obstacle.half_extents_m is not None:
        return abs(dx) <= obstacle.half_extents_m[0] and abs(dy) <= obstacle.half_extents_m[1]
    return dx * dx + dy * dy <= (obstacle.radius_m or 0.0) ** 2


def _holds(area: tuple[float, float, float, float], x: float, y: float) -> bool:
    left, bottom, right, top = area
    return left <= x <= right and bottom <= y <= top
