"""What a robot sees as pictures and pages have it, against what the worlds say it saw."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import opened_browser, until, visit
from matplotlib.figure import Figure
from playwright.sync_api import Browser
from watched import watched

from innerattn.config import Map, Obstacle, Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.render import PALE
from innerattn.records.record import Record
from innerattn.report.replay.page import replay_page
from innerattn.report.replay.picture import _paint
from innerattn.report.replay.sight import in_sight, sees_all

WHEELS = Scenario.preset("mixed-wheels")
SHAPES = (
    Obstacle(shape="disc", radius_m=0.2, position_m=(0.3, 0.2)),
    Obstacle(shape="box", half_extents_m=(0.1, 0.3), position_m=(-0.3, -0.2)),
    Obstacle(shape="disc", radius_m=0.1, layers=("air",)),
)
ROWS = (
    "........",
    "........",
    ".##.....",
    "........",
    "........",
    ".....#..",
    "........",
    "........",
)


def limited(sight_m: float | None, field_deg: float, occlusion: bool) -> Scenario:
    first, *others = WHEELS.robots
    front = [one for one in WHEELS.robots if one.has_wheels]
    assert first in front
    robots = (
        first.replace(sight_m=sight_m, field_of_view_deg=field_deg),
        others[0].replace(sight_m=0.6),
        others[1].replace(layer="air"),
        *others[2:],
    )
    hiding = {"obstacles": SHAPES, "map": Map(rows=ROWS, layers=("ground",))} if occlusion else {}
    return WHEELS.replace(robots=robots, occlusion=occlusion, engine="discs", **hiding)


SCENARIOS = {
    "near": limited(0.7, 360.0, False),
    "ahead": limited(None, 100.0, False),
    "behind obstacles": limited(None, 360.0, True),
    "all of it": limited(1.0, 200.0, True),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_it_is_what_the_worlds_say(name: str) -> None:
    scenario = SCENARIOS[name]
    draws, found = np.random.default_rng(3), []
    with BatchEnv(scenario, 40, seed=5, num_threads=1) as env:
        env.reset()
        for _ in range(12):
            env.step(draws.integers(0, 5, (40, env.num_robots)))
            said = env.last_seen() == env.step_counts()[:, None, None]
            victims = env.victims()
            spots = np.stack([victims["x"], victims["y"]], -1)
            spots[~victims["present"]] = np.nan
            places = np.concatenate([env.positions(), spots], 1)
            for world, robot in np.ndindex(40, env.num_robots):
                if sees_all(scenario, robot):
                    continue
                seen = in_sight(
                    scenario,
                    robot,
                    env.positions()[world, robot],
                    float(env.headings()[world, robot]),
                    env.obstacles()[world],
                    places[world],
                )
                seen[robot] = False
                found.append(seen == said[world, robot])
                assert seen.any() or not said[world, robot].any()
    agrees = np.concatenate(found)
    # In single precision a border may lie a hair's breadth elsewhere.
    assert (~agrees).sum() <= 2
    assert len(agrees) > 2000


def test_who_sees_everything() -> None:
    assert [sees_all(WHEELS, robot) for robot in range(4)] == [True] * 4
    assert [sees_all(SCENARIOS["near"], robot) for robot in range(4)] == [False, False, True, True]
    assert not any(sees_all(SCENARIOS["behind obstacles"], robot) for robot in range(4))


def test_a_picture_paints_faintly_what_the_chosen_robot_does_not_see() -> None:
    record = watched(SCENARIOS["all of it"], episodes=2, heads=0)
    places = BatchEnv(record.scenario, 1).obstacles()[0]
    pale = 0
    for step in (0, 8, 16):
        axes = Figure().add_subplot()
        legend = _paint(axes, record, "a", 1, float(step), places, ("food_0",), "attention")
        robots, victims = hidden(record, 1, step, 0)
        discs = axes.patches[-4:]
        assert [one for one in range(4) if discs[one].get_alpha() == PALE] == robots
        assert {one.get_alpha() for one in discs} <= {PALE, 1.0}
        kept = record.steps["victims"][1, step]
        wanted = {float(one["x"]) for one in kept[kept["present"]] if one["id"] in victims}
        marks = [one for one in axes.lines if one.get_markersize() == 11 and one.get_alpha()]
        assert {float(one.get_xdata()[0]) for one in marks if one.get_alpha() == PALE} == wanted
        assert "out of sight\nof food_0" in legend
        pale += len(robots) + len(victims)
    assert pale > 3
    for robots_shown in (("medical_0", "food_0"), record.robot_names):
        axes = Figure().add_subplot()
        legend = _paint(axes, record, "a", 1, 8.0, places, robots_shown, "attention")
        assert all(one.get_alpha() == 1.0 for one in axes.patches[-4:])
        assert not any(label.startswith("out of sight") for label in legend)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


def hidden(record: Record, episode: int, step: int, robot: int) -> tuple[list[int], list[int]]:
    """Robots, and numbers of victims, that a robot does not see in a record."""
    kept = {field: values[episode, step] for field, values in record.steps.items()}
    victims = kept["victims"][kept["victims"]["present"].astype(bool)]
    places = np.stack([victims["x"], victims["y"]], -1)
    env = BatchEnv(record.scenario, record.num_episodes, record.seed, num_threads=1)
    env.reset()
    seer = kept["positions"][robot], float(kept["headings"][robot, 0]), env.obstacles()[episode]
    robots, slots = (
        in_sight(record.scenario, robot, *seer, some) for some in (kept["positions"], places)
    )
    others = [int(one) for one in np.flatnonzero(~robots) if one != robot]
    return others, sorted(victims["id"][~slots].tolist())


@pytest.mark.parametrize("name", ["ahead", "all of it"])
def test_a_page_draws_faintly_what_the_chosen_robot_does_not_see(
    browser: Browser, tmp_path: Path, name: str
) -> None:
    record = watched(SCENARIOS[name], episodes=3, heads=0)
    path = tmp_path / "replay.html"
    path.write_text(replay_page([record], ["team"]), "utf-8")
    shown, faint = 0, "replay.scenes[0].unseen"
    with visit(browser, path) as seen:
        page = seen.page
        until(page, "Boolean(window.replay)")
        for episode in range(3):
            for step in (0, 6, 15, 23):
                for robot in range(4):
                    page.evaluate(
                        "([e, s, r]) => { replay.setEpisode(e); replay.goTo(s);"
                        " replay.setLook({ robot: r }); }",
                        [episode, step, robot],
                    )
                    found = page.evaluate(faint)
                    robots, victims = hidden(record, episode, step, robot)
                    if sees_all(record.scenario, robot):
                        robots, victims = [], []
                    assert found["robots"] == robots
                    assert sorted(found["victims"]) == victims
                    shown += len(robots) + len(victims)
        assert shown > 10
        page.evaluate("replay.setLook({ robot: -1 })")
        assert page.evaluate(faint) == {"robots": [], "victims": []}
        page.evaluate("replay.setLook({ robot: 0 })")
        pixels = "document.querySelector('canvas').toDataURL()"
        page.get_by_role("checkbox", name="sight").uncheck()
        assert page.evaluate(faint) == {"robots": [], "victims": []}
        without = page.evaluate(pixels)
        page.get_by_role("checkbox", name="sight").check()
        assert page.evaluate(pixels) != without
        assert "out of sight of the chosen robot" in (page.locator("#legend").text_content() or "")
        assert not seen.serious_faults()
