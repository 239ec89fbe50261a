"""What robots hear and measure on the page to play with: it is what the world says now."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from browser import opened_browser, until, visit
from played import played, scripted_world
from playwright.sync_api import Browser, Page

from innerattn.config import Scenario
from innerattn.config.communication import Communication
from innerattn.config.range_sensor import RangeSensor
from innerattn.report.play.state import state_document


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


def ready(page: Page) -> None:
    until(page, "Boolean(window.play)")
    page.get_by_role("button", name="Pause").click()
    settle(page)


def settle(page: Page) -> None:
    """Wait for answers that are under way, and until the page shows the last state."""
    until(page, "!play.link.busy && !play.stale && play.hands.step === play.run.last")


def sensing() -> Scenario:
    scenario = Scenario.preset("mixed")
    sensor = RangeSensor(rays=16, range_m=0.8)
    first, *others = scenario.robots
    return scenario.replace(
        robots=(first.replace(range_sensor=sensor), *others),
        communication=Communication(range_m=1.2, loss=0.2),
    )


def test_the_state_has_what_robots_hear_and_measure() -> None:
    heard = 0
    with closing(scripted_world(sensing())()) as world:
        for _ in range(20):
            world.step()
            moment, document = world.moment(), state_document(world.moment())
            assert moment.heard is not None
            assert moment.rays is not None
            assert document["heard"] == moment.heard.astype(int).tolist()
            heard += int(moment.heard.sum())
            shown = np.array(document["rays"])
            np.testing.assert_allclose(shown, moment.rays, atol=1e-5)
            np.testing.assert_array_equal(shown > 0, moment.rays > 0)
            assert not moment.rays[1:].any()
    assert heard > 20
    with closing(scripted_world()()) as plain:
        document = state_document(plain.moment())
    assert document["heard"] is None
    assert document["rays"] is None


def test_a_robot_put_beside_a_wall_measures_it(browser: Browser) -> None:
    with played(scripted_world(sensing())) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        page.evaluate("play.setLook({ robot: 0, hearing: 'all' })")
        half = sensing().arena_half_width_m
        message = {"do": "move_robot", "robot": 0, "x": half - 0.3, "y": 0.0}
        page.evaluate("(message) => play.send(message)", message)
        settle(page)
        until(page, "play.scene.rays.length === 16 && play.scene.rays[0].met")
        end = page.evaluate("play.scene.rays[0]")
        assert end["x"] == pytest.approx(half, abs=1e-4)
        assert end["y"] == pytest.approx(0.0, abs=1e-4)
        now = np.array(page.evaluate("play.run.now.heard"))
        assert page.evaluate("play.scene.heard") == np.argwhere(now).tolist()
        page.get_by_role("checkbox", name="rays").uncheck()
        page.get_by_label("Who hears whom").select_option("none")
        settle(page)
        assert page.evaluate("[play.scene.rays.length, play.scene.heard.length]") == [0, 0]
        assert not seen.serious_faults()


def test_what_the_chosen_robot_does_not_see_is_faint(browser: Browser) -> None:
    preset = Scenario.preset("mixed")
    first, *others = preset.robots
    scenario = preset.replace(robots=(first.replace(sight_m=0.5), *others))
    with played(scripted_world(scenario)) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        for robot, x, hidden in (
            (1, 0.3, False),
            (1, 0.7, True),
            (2, -0.6, True),
            (2, -0.4, False),
        ):
            for index, at in ((0, 0.0), (robot, x)):
                message = {"do": "move_robot", "robot": index, "x": at, "y": 0.0}
                page.evaluate("(message) => play.send(message)", message)
                settle(page)
            page.evaluate("play.setLook({ robot: 0 })")
            settle(page)
            page.wait_for_timeout(50)
            assert (robot in page.evaluate("play.scene.unseen.robots")) == hidden
            page.evaluate("(robot) => play.setLook({ robot })", robot)
            settle(page)
            page.wait_for_timeout(50)
            assert page.evaluate("play.scene.unseen") == {"robots": [], "victims": []}
        assert not seen.serious_faults()


def test_no_switch_without_such_senses(browser: Browser) -> None:
    with played(scripted_world()) as server, visit(browser, server.address) as seen:
        ready(seen.page)
        assert seen.page.locator("#senses").is_hidden()
