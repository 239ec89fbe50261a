"""Robots that are added on pages: they answer as the server does, and show who is there."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from answers import ANSWER, like, served
from browser import PHONE, WIDE, Visit, until, visit
from played import played
from playwright.sync_api import Browser, Page
from spare_robots import SEED, spared_world
from team_of_any import TEAM

from innerattn.evaluate.spares import with_spares
from innerattn.report.page.page import page_document, worlds_page
from innerattn.report.page.team import PageTeam, read_team

WORLDS = with_spares(TEAM, 2)
STEP = {"do": "step"}


def out(robot: int) -> dict[str, Any]:
    return {"do": "faults", "robot": robot, "values": {"unavailable": 1.0}}


def add(kind: str) -> dict[str, Any]:
    return {"do": "add_robot", "kind": kind}


MESSAGES = [
    *[STEP] * 20,
    out(2),
    *[STEP] * 10,
    add("digger"),
    add("medic"),
    *[STEP] * 40,
    add("digger"),
    add("digger"),  # refused
    add("food"),  # refused
    {"do": "faults", "robot": 7, "values": {"blackout": 1.0, "unavailable": 1.0}},
    out(4),
    out(9),
    *[STEP] * 30,
    add("digger"),
    *[STEP] * 10,
    {"do": "restart"},
    add("drone"),
    *[STEP] * 10,
]


def policies_of(names: tuple[str, ...]) -> dict[str, PageTeam | None]:
    return {one: read_team("zoo:any", WORLDS) if one == "any" else None for one in names}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A page with one arena, and one with two."""
    folder = tmp_path_factory.mktemp("page")
    one, two = folder / "one.html", folder / "two.html"
    text = worlds_page("any", WORLDS, policies_of(("any", "greedy")), SEED, num_own=5)
    one.write_text(text, "utf-8")
    policies = policies_of(("hungarian", "greedy"))
    text = worlds_page("hungarian beside greedy", WORLDS, policies, SEED, "greedy", 5)
    two.write_text(text, "utf-8")
    return one, two


@pytest.fixture(scope="module")
def shared(browser: Browser, files: tuple[Path, Path]) -> Iterator[Page]:
    with visit(browser, files[0]) as seen:
        ready(seen.page)
        yield seen.page


def ready(page: Page) -> None:
    until(page, "Boolean(window.play)")
    page.get_by_role("button", name="Pause").click()
    settle(page)
    page.get_by_role("button", name="Start from it").click()
    settle(page)


def settle(page: Page) -> None:
    until(page, "!play.arenas.some((one) => one.link.busy) && !play.stale && !play.fresh")


def button(page: Page, kind: str) -> Any:
    return page.get_by_role("group", name="Add a robot").get_by_role("button", name=kind)


def listed(page: Page) -> list[str]:
    return page.locator("#robots li:visible strong").all_inner_texts()


def there(page: Page) -> Any:
    """Names of the robots in each arena."""
    return page.evaluate(
        """play.arenas.map(({ run, worlds }) => worlds.robots.flatMap(({ name }, robot) => (
          run.now.faults[robot].unavailable >= 1 ? [] : [name])))"""
    )


@pytest.mark.parametrize("name", ["greedy", "hungarian", "any"])
def test_it_answers_as_the_server_of_play_does(shared: Page, name: str) -> None:
    policy = "zoo:any" if name == "any" else name
    theirs = served(lambda: spared_world(TEAM, 2, policy), MESSAGES)
    given = page_document(WORLDS, policies_of((name,)), SEED, 5)
    ours = shared.evaluate(ANSWER, [given, MESSAGES])
    assert [one.get("error") for one in ours] == [one.get("error") for one in theirs]
    assert [one["error"] for one in ours if "error" in one] == [
        "all 2 spare digger robots are in the arena: take one out first",
        "kind = 'food': must be one of drone, digger, medic",
    ]
    assert ours[0]["worlds"] == theirs[0]["worlds"]
    assert [one.get("is_spare", False) for one in ours[0]["worlds"]["robots"]] == (
        [False] * 5 + [True] * 6
    )
    for at, (one, other) in enumerate(zip(ours, theirs, strict=True)):
        if "error" in one:
            continue
        assert one["faults"] == other["faults"], at
        np.testing.assert_allclose(one["positions"], other["positions"], atol=2e-5, err_msg=str(at))
        assert one["rescued"] == other["rescued"], at
    assert theirs[-13]["rescued"] > 2
    like(ours[1], theirs[1])


def test_a_robot_is_added_and_taken_out(browser: Browser, files: tuple[Path, Path]) -> None:
    own = [one.name for one in TEAM.robots]
    with visit(browser, files[0]) as seen:
        page = seen.page
        ready(page)
        assert "5 robots rescue victims" in page.locator("#subtitle").inner_text()
        assert "Add one, and it joins the work." in page.locator("#subtitle").inner_text()
        assert listed(page) == own
        texts = page.locator("#kinds button").all_inner_texts()
        assert texts == ["drone 2 left", "digger 2 left", "medic 2 left"]
        button(page, "drone").click()
        settle(page)
        assert there(page) == [[*own, "drone_2"]]
        assert listed(page) == [*own, "drone_2"]
        assert page.get_by_role("heading", name="drone_2").is_visible(), "it is chosen"
        assert button(page, "drone").inner_text() == "drone 1 left"
        assert page.locator("#events").get_by_text("drone_2 joins").is_visible()
        page.evaluate("play.send({ do: 'step' })")
        settle(page)
        until(page, "document.querySelectorAll('.chart').length > 0 && !play.chartsAreOld")
        labels = page.locator(".chart text").all_text_contents()
        assert "drone_2" in labels
        assert not {"drone_3", "digger_2", "medic_0"} & set(labels)
        assert page.locator(".chart .fault").count() == 0, "to wait outside is no fault"
        button(page, "drone").click()
        settle(page)
        button(page, "drone").click()
        page.get_by_role("alert").get_by_text("All 2 drone robots that can be added").wait_for()
        assert there(page) == [[*own, "drone_2", "drone_3"]]
        page.keyboard.press("o")
        settle(page)
        assert there(page) == [[*own, "drone_2"]]
        assert listed(page) == [*own, "drone_2"]
        assert page.get_by_role("heading", name="drone_0").is_visible()
        assert page.locator("#events").get_by_text("drone_3 leaves").is_visible()
        page.keyboard.press("n")
        settle(page)
        assert there(page) == [own]
        assert page.locator("#events li").count() == 0
        chosen = []
        for _ in range(6):
            page.keyboard.press("r")
            chosen.append(page.evaluate("play.worlds.robots[play.look.robot].name"))
        assert chosen == [*own[1:], *own[:2]]


def test_a_robot_that_is_steered_leaves(browser: Browser, files: tuple[Path, Path]) -> None:
    with visit(browser, files[0]) as seen:
        page = seen.page
        ready(page)
        button(page, "medic").click()
        settle(page)
        page.keyboard.press("s")
        page.get_by_role("button", name="Pause").click()
        settle(page)
        assert page.evaluate("play.run.now.steered") == 9
        page.keyboard.press("o")
        settle(page)
        assert page.evaluate("play.run.now.steered") is None


def test_robots_are_added_to_both_arenas_or_to_one(
    browser: Browser, files: tuple[Path, Path]
) -> None:
    own = [one.name for one in TEAM.robots]
    with visit(browser, files[1]) as seen:
        page = seen.page
        ready(page)
        button(page, "drone").click()
        settle(page)
        assert there(page) == [[*own, "drone_2"]] * 2
        first, second = page.evaluate("play.arenas.map(({ run }) => run.now.positions[5])")
        assert first == second
        page.get_by_role("checkbox", name="apply to both").uncheck()
        button(page, "drone").click()
        settle(page)
        assert there(page) == [[*own, "drone_2", "drone_3"], [*own, "drone_2"]]
        assert page.get_by_role("heading", name="drone_3 in A").is_visible()
        page.keyboard.press("x")
        settle(page)
        assert page.get_by_role("heading", name="drone_0 in B").is_visible()
        assert listed(page) == [*own, "drone_2"]
        page.get_by_role("checkbox", name="apply to both").check()
        button(page, "drone").click()
        settle(page)
        assert there(page) == [[*own, "drone_2", "drone_3"]] * 2
        assert not page.locator("#events").get_by_text("fault").count()


def test_without_spare_robots_nothing_is_offered(browser: Browser) -> None:
    with (
        played(lambda: spared_world(TEAM, 0, "greedy")) as server,
        visit(browser, server.address) as seen,
    ):
        ready(seen.page)
        assert seen.page.get_by_text("Add a robot").is_hidden()
        assert "Add one" not in seen.page.locator("#subtitle").inner_text()


def test_the_server_lets_robots_in_too(browser: Browser) -> None:
    with (
        played(lambda: spared_world(TEAM, 1, "hungarian")) as server,
        visit(browser, server.address) as seen,
    ):
        page = seen.page
        ready(page)
        button(page, "medic").click()
        settle(page)
        assert there(page)[0][-1] == "medic_0"
        assert listed(page)[-1] == "medic_0"


@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_everybody_can_use_it(
    browser: Browser, files: tuple[Path, Path], size: tuple[int, int]
) -> None:
    with visit(browser, files[0], size) as seen:
        page = seen.page
        ready(page)
        for kind in ("drone", "digger", "medic"):
            button(page, kind).click()
            settle(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        least = 40 if size == PHONE else 30
        box = button(page, "digger").bounding_box()
        assert box is not None
        assert box["height"] >= least
        assert not Visit(page).serious_faults()
