"""What robots hear, measure and see on the replay page: what is drawn is what was recorded."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PHONE, opened_browser, until, visit
from playwright.sync_api import Browser, Page
from sensing import sensing
from watched import watched

from innerattn.records.record import Record
from innerattn.report.replay.page import replay_page


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


def written(folder: Path, record: Record) -> Path:
    path = folder / "replay.html"
    path.write_text(replay_page([record], ["team"]), "utf-8")
    return path


def ready(page: Page) -> None:
    until(page, "Boolean(window.replay)")


def pixels(page: Page) -> str:
    return str(page.evaluate("document.querySelector('canvas').toDataURL()"))


def pairs(heard: Any, *hearers: int) -> list[list[int]]:
    """[who hears, who is heard], in the order in which a page draws them."""
    return [[i, int(j)] for i in hearers for j in np.flatnonzero(heard[i])]


def look(page: Page, **values: Any) -> None:
    page.evaluate("(look) => replay.setLook(look)", values)


def test_what_is_drawn_is_what_was_recorded(browser: Browser, tmp_path: Path) -> None:
    scenario = sensing()
    record, drawn = watched(scenario, episodes=3), 0
    with visit(browser, written(tmp_path, record)) as seen:
        page = seen.page
        ready(page)
        for episode, step, robot in ((0, 0, 0), (1, 7, 3), (2, 20, 1), (2, 24, 2)):
            page.evaluate(
                "([episode, step]) => { replay.setEpisode(episode); replay.goTo(step); }",
                [episode, step],
            )
            heard = record.steps["heard"][episode, step]
            look(page, robot=robot, hearing="own")
            assert page.evaluate("replay.scenes[0].heard") == pairs(heard, robot)
            look(page, hearing="all")
            assert page.evaluate("replay.scenes[0].heard") == pairs(heard, 0, 1, 2, 3)
            look(page, hearing="none")
            assert page.evaluate("replay.scenes[0].heard") == []
            drawn += int(heard.sum())
            shown = page.evaluate("replay.scenes[0].rays")
            sensor = scenario.robots[robot].range_sensor
            if sensor is None:
                assert shown == []
                continue
            readings = record.steps["rays"][episode, step, robot, : sensor.rays]
            angles = record.steps["headings"][episode, step, robot, 0] + sensor.angles_rad()
            way = np.stack([np.cos(angles), np.sin(angles)], -1)
            far = (1.0 - readings[:, None]) * sensor.range_m
            ends = record.steps["positions"][episode, step, robot] + far * way
            assert [one["robot"] for one in shown] == [robot] * sensor.rays
            assert [one["met"] for one in shown] == (readings > 0).tolist()
            np.testing.assert_allclose([(one["x"], one["y"]) for one in shown], ends, atol=3e-4)
        look(page, robot=-1)
        counts = [robot.range_sensor.rays for robot in scenario.robots if robot.range_sensor]
        assert page.evaluate("replay.scenes[0].rays.length") == sum(counts)
    assert drawn > 10


def test_switches_change_what_is_drawn_and_marks_are_explained(
    browser: Browser, tmp_path: Path
) -> None:
    record = watched(sensing(), episodes=2, heads=0)
    with visit(browser, written(tmp_path, record)) as seen:
        page = seen.page
        ready(page)
        page.evaluate("replay.goTo(8)")  # in the first step nobody hears anything
        look(page, robot=0)
        shown = [pixels(page)]
        for name in ("rays", "sight"):
            page.get_by_role("checkbox", name=name).uncheck()
            shown.append(pixels(page))
        for value in ("all", "none"):
            page.get_by_label("Who hears whom").select_option(value)
            shown.append(pixels(page))
        assert len(set(shown)) == 5
        legend = page.locator("#legend").text_content() or ""
        assert "thin arrow: the robot at its head hears the one at its start" in legend
        assert "rays of its range sensor" in legend
        assert "how far it sees" in legend
        assert not seen.serious_faults()


def test_switches_are_only_where_there_are_such_senses(browser: Browser, tmp_path: Path) -> None:
    old = watched(sensing(), episodes=1)
    kept = {name: v for name, v in old.steps.items() if name not in ("heard", "rays")}
    records = {"plain": watched(episodes=1), "older": replace(old, steps=kept)}
    for name, expected in (("plain", 0), ("older", 1)):
        (tmp_path / name).mkdir()
        with visit(browser, written(tmp_path / name, records[name])) as seen:
            ready(seen.page)
            assert seen.page.locator("#senses input, #senses select").count() == expected
            assert seen.page.evaluate("replay.scenes[0].rays") == []
            assert seen.page.evaluate("replay.scenes[0].heard") == []
            assert seen.page.locator("#senses").is_hidden() == (expected == 0)


def test_a_phone_shows_all_switches(browser: Browser, tmp_path: Path) -> None:
    with visit(browser, written(tmp_path, watched(sensing(), episodes=1)), PHONE) as seen:
        ready(seen.page)
        assert seen.page.locator("#senses label").count() == 3
        assert seen.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
