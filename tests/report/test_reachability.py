"""What obstacles keep from robots, in worlds whose answer is plain."""

from typing import Any

import pytest

from innerattn.config import Scenario
from innerattn.report.reachability import closed_off
from innerattn.report.scenario_words import scenario_words


def wall(gap: float) -> list[dict[str, Any]]:
    """A wall from side to side at y = 0 with a gap in its middle [m]."""
    half = (1.0 - gap / 2.0) / 2.0
    middle = gap / 2.0 + half
    return [
        {"shape": "box", "half_extents_m": [half, 0.05], "position_m": [x, 0.0]}
        for x in (-middle, middle)
    ]


def robot(name: str, ability: str, radius: float, start: list[float] | None = None) -> Any:
    words = {"name": name, "kind": name, "abilities": [ability], "radius_m": radius}
    return words | {"max_speed_mps": 1.0, "mass_kg": 1.0} | ({"start_m": start} if start else {})


def scenario(gap: float, **changes: Any) -> Scenario:
    values: dict[str, Any] = {
        "robots": [robot("a", "lift", 0.05, [0.0, -0.5]), robot("b", "water", 0.05, [0.3, -0.5])],
        "tasks": [{"name": "beam", "needs": ["lift", "water"]}],
        "obstacles": wall(gap),
        "victim_places_m": [[0.5, -0.5], [0.0, 0.5]],
    }
    return Scenario.model_validate(values | changes)


def test_a_gap_must_be_wider_than_the_robot() -> None:
    assert list(closed_off(scenario(0.14))) == []
    assert list(closed_off(scenario(0.06))) == [
        "place (0, 0.5): obstacles keep every robot with lift away from it",
        "place (0, 0.5): obstacles keep every robot with water away from it",
    ]
    assert "place (0, 0.5): obstacles keep" in scenario_words(scenario(0.06))


def test_one_robot_that_gets_through_is_enough() -> None:
    robots = [
        robot("a", "lift", 0.05, [0.0, -0.5]),
        robot("b", "water", 0.05, [0.3, -0.5]),
        robot("c", "lift", 0.02, [-0.3, -0.5]),
        robot("d", "water", 0.05, [0.5, 0.5]),
    ]
    assert list(closed_off(scenario(0.06, robots=robots))) == []


def test_robots_without_a_start_may_begin_on_either_side() -> None:
    robots = [robot("a", "lift", 0.05), robot("b", "water", 0.05)]
    assert list(closed_off(scenario(0.06, robots=robots))) == []


def test_a_share_of_the_area_is_named() -> None:
    found = list(closed_off(scenario(0.06, victim_places_m=[])))
    assert found == [
        f"victims: obstacles keep every robot with {need} away from 49 % of their area"
        for need in ("lift", "water")
    ]
    # Beyond the wall, less the strip that robots below it still reach: 0.83 of 1.7 m.
    near = [-0.5, -0.9, 0.5, -0.1]
    assert list(closed_off(scenario(0.06, victim_places_m=[], victim_area_m=near))) == []


def test_areas_of_tasks_count_each_for_itself() -> None:
    below, above = [-0.9, -0.9, 0.9, -0.1], [-0.9, 0.3, 0.9, 0.9]
    tasks = [
        {"name": "beam", "needs": ["lift"], "area_m": above},
        {"name": "leak", "needs": ["water"], "area_m": below},
    ]
    closed = scenario(0.06, victim_places_m=[], tasks=tasks)
    assert list(closed_off(closed)) == [
        "victims of beam: obstacles keep every robot with lift away from 100 % of their area"
    ]
    whole = [tasks[0], {"name": "leak", "needs": ["water"]}]
    assert [line[:15] for line in closed_off(closed.replace(tasks=whole))] == [
        "victims of beam",
        "victims: obstac",
    ]
    whole = [tasks[1], {"name": "beam", "needs": ["lift"]}]
    three = {"victim_places_m": [[0.5, -0.5], [0.0, 0.5], [0.4, -0.5]]}
    places = scenario(0.06, tasks=whole, situation="double", **three)
    assert list(closed_off(places)) == [
        "place (0, 0.5): obstacles keep every robot with lift away from it"
    ]


@pytest.mark.parametrize("shape", [None, "disc"])
def test_without_obstacles_that_have_a_place_nothing_is_closed(shape: str | None) -> None:
    obstacles = [{"shape": shape, "radius_m": 0.2}] if shape else []
    assert list(closed_off(scenario(0.0, obstacles=obstacles))) == []


def test_discs_close_a_corner() -> None:
    discs = [
        {"shape": "disc", "radius_m": 0.2, "position_m": [x, y]}
        for x, y in ((0.5, 0.85), (0.5, 0.5), (0.85, 0.5))
    ]
    found = list(
        closed_off(scenario(0.0, obstacles=discs, victim_places_m=[[0.8, 0.8], [0.9, 0.9]]))
    )
    assert len(found) == 4
    assert [line.partition(":")[0] for line in found] == [
        f"place ({at:g}, {at:g})" for _ in ("lift", "water") for at in (0.8, 0.9)
    ]


def test_obstacles_keep_robots_of_the_layers_that_they_block() -> None:
    made = scenario(0.06)
    flying = made.robots[0].replace(layer="air")
    walls = tuple(one.replace(layers=("ground",)) for one in made.obstacles)
    found = list(closed_off(made.replace(robots=(flying, made.robots[1]), obstacles=walls)))
    assert found == ["place (0, 0.5): obstacles keep every robot with water away from it"]
