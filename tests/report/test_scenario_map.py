"""A scenario as a map of characters."""

from innerattn.config import Obstacle, Scenario
from innerattn.report.scenario_map import scenario_map


def rows(scenario: Scenario) -> list[str]:
    """What is inside the walls, from the top."""
    return [line[1:-1] for line in scenario_map(scenario).splitlines() if line.startswith("|")]


def test_places_are_where_they_belong() -> None:
    team = Scenario().robots
    robots = (team[0].replace(start_m=(-0.94, 0.94)), team[1], team[2].replace(start_m=(0.5, -0.5)))
    obstacles = (
        Obstacle(shape="box", half_extents_m=(0.5, 0.2), position_m=(0.0, 0.0)),
        Obstacle(shape="disc", radius_m=0.1),
    )
    task = Scenario().tasks[1]
    scenario = Scenario(robots=robots, tasks=(task,), obstacles=obstacles)
    drawn = rows(scenario)
    assert {len(row) for row in drawn} == {61}
    assert drawn[0][1] == "A"
    assert [row.index("B") for row in drawn if "B" in row] == [45]
    solid = [row.count("#") for row in drawn]
    assert solid.count(31) == 7  # half as wide as the arena, a fifth as high
    assert solid[15] == 31
    assert drawn[15][30] == "#"
    legend = scenario_map(scenario)
    assert "A  food_0 starts here (food)" in legend
    assert "B  navigation_0 starts here (information)" in legend
    assert "At new random places in each episode: 1 robot, 1 obstacle" in legend


def test_areas_and_places_of_victims() -> None:
    drawn = rows(Scenario(victim_area_m=(-0.5, 0.0, 0.5, 0.5)))
    assert sum("·" in row for row in drawn) == 8
    assert all(row.startswith("  ") and row.endswith("  ") for row in drawn)
    everywhere = rows(Scenario())
    assert everywhere[15].count("·") == 55
    listed = Scenario(victim_places_m=((0.0, 0.0), (0.5, 0.5)))
    assert rows(listed)[15][30] == "x"
    assert sum(row.count("x") for row in rows(listed)) == 2
    assert "x  a victim may appear here" in scenario_map(listed)
    assert "·" not in scenario_map(listed)


def test_areas_of_tasks_are_drawn_together() -> None:
    left, right = Scenario().tasks
    left = left.replace(area_m=(-0.9, 0.0, -0.5, 0.5))
    sites = Scenario(tasks=(left, right.replace(area_m=(0.5, 0.0, 0.9, 0.5))))
    drawn = [row for row in rows(sites) if "·" in row]
    assert len(drawn) == 8
    assert all(row.split() == ["·" * 12, "·" * 12] for row in drawn)
    one = rows(Scenario(tasks=(left, right), victim_area_m=(0.0, -0.5, 0.5, 0.0)))
    assert [sum("·" in row[half] for row in one) for half in (slice(30), slice(31, 61))] == [8, 8]
    beside = Scenario(
        tasks=(left, right.replace(area_m=(0.5, 0.0, 0.9, 0.5))),
        victim_places_m=((-0.6, 0.2), (-0.7, 0.4), (0.7, 0.2), (0.8, 0.4), (0.0, -0.5)),
    )
    assert sum(row.count("x") for row in rows(beside)) == 4, "no task has the last place"


def test_obstacles_that_some_pass_have_their_own_sign() -> None:
    preset = Scenario.preset("air-ground")
    assert {sign for row in rows(preset) for sign in row} == {" ", "·", "%"}
    assert "%  an obstacle that robots of some layers pass" in scenario_map(preset)
    assert "an obstacle\n" not in scenario_map(preset)
    first, *others = preset.robots
    named = scenario_map(preset.replace(robots=(first.replace(start_m=(0.0, 0.0)), *others)))
    assert "A  food_0 starts here (food; layer air)" in named
