"""Two policies side by side: worlds that begin alike, one clock, and hands that reach into both."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PHONE, WIDE, Visit, until, visit
from played import played, scripted_world
from playwright.sync_api import Browser, Page

from innerattn.config import Scenario
from innerattn.measures.cooperation import count_cooperation
from innerattn.report.page.page import worlds_page
from innerattn.report.page.team import read_team

SEED = 12_345

# Does steps in both arenas; gives what each has rescued, step by step.
STEPS = """async (steps) => {
  const found = play.arenas.map(() => []);
  for (let step = 0; step < steps; step++) {
    await play.sendAll({ do: "step" });
    play.arenas.forEach(({ link }, index) => {
      const session = link.transport.sessions?.get(link.session);
      found[index].push(...(session?.rescues ?? []));
    });
  }
  return found;
}"""

# Does the same with one policy alone; gives its state at the end.
ALONE = """async ([policy, steps]) => {
  const { given, rust, constructor: Inside } = play.link.transport;
  const inside = new Inside(rust, given), { session } = await inside.ask("sessions", {});
  const path = `sessions/${session}`;
  let state = await inside.ask(path, { do: "policy", name: policy });
  for (let at = 0; at < steps; at++) state = await inside.ask(path, { do: "step" });
  inside.leave(path);
  return state;
}"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "page.html"
    team = read_team("zoo:mixed")
    policies = {"mixed": team, "greedy": None, "random": None}
    title = "mixed beside greedy"
    path.write_text(
        worlds_page(title, team.config.scenario, policies, SEED, beside="greedy"), "utf-8"
    )
    return path


@pytest.fixture
def page(browser: Browser, file: Path) -> Iterator[Page]:
    """The page, paused at the start of the worlds."""
    with visit(browser, file) as seen:
        ready(seen.page)
        yield seen.page


def ready(page: Page) -> None:
    until(page, "Boolean(window.play)")
    page.get_by_role("button", name="Pause").click()
    settle(page)
    page.get_by_role("button", name="Start from it").click()
    settle(page)


def settle(page: Page) -> None:
    until(page, "!play.arenas.some((one) => one.link.busy || one.movesNow) && !play.stale")


def both(page: Page, key: str) -> Any:
    return page.evaluate(f"play.arenas.map(({{ run }}) => run.now.{key})")


def test_both_begin_alike_and_keep_one_time(page: Page) -> None:
    first, second = both(page, "positions")
    assert first == second
    assert both(page, "policy") == ["mixed", "greedy"]
    assert both(page, "step") == [0, 0]
    page.get_by_role("button", name="Run").click()
    until(page, "play.run.last >= 5")
    page.keyboard.press("Space")
    settle(page)
    first, second = both(page, "step")
    assert first == second
    page.keyboard.press("n")
    settle(page)
    assert both(page, "episode") == [1, 1]
    first, second = both(page, "victims")
    assert first == second


def test_each_does_what_it_does_alone(page: Page) -> None:
    page.get_by_role("button", name="New start").click()
    page.reload()
    until(page, "Boolean(window.play)")
    page.get_by_role("button", name="Pause").click()
    settle(page)
    done = both(page, "step")[0]
    page.evaluate(STEPS, 300 - done)
    settle(page)
    for policy, state in zip(("mixed", "greedy"), both(page, "positions"), strict=True):
        assert state == page.evaluate(ALONE, [policy, 300])["positions"]


def test_hands_reach_into_both_or_into_one(page: Page) -> None:
    page.get_by_role("button", name="Take out").click()
    settle(page)
    assert [one[0] for one in both(page, "faults")] == [{"unavailable": 1}] * 2
    page.get_by_role("checkbox", name="apply to both").uncheck()
    page.get_by_role("group", name="Charts, robots and victims of").get_by_text("greedy").click()
    settle(page)
    assert page.get_by_role("heading", name="food_0 in B").is_visible()
    page.get_by_role("button", name="Take out").click()
    settle(page)
    assert [one[0] for one in both(page, "faults")] == [{"unavailable": 1}, {}]
    assert page.locator("#events").get_by_text("B: end of a fault: food_0").is_visible()
    page.keyboard.press("x")
    settle(page)
    assert page.get_by_role("heading", name="food_0 in A").is_visible()
    page.keyboard.press("Shift+ArrowUp")
    settle(page)
    pushed, other = both(page, "velocities")
    assert pushed[0][1] == pytest.approx(other[0][1] + 1.5)


def test_a_drag_in_the_second_arena_moves_both(page: Page) -> None:
    start, end = (
        page.evaluate(f"play.arenas[1].scene.at(...{place})")
        for place in ("play.arenas[1].run.now.positions[2]", "[0.3, -0.6]")
    )
    box = page.get_by_role("img", name="Arena B").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + start[0], box["y"] + start[1])
    page.mouse.down()
    page.mouse.move(box["x"] + end[0], box["y"] + end[1], steps=4)
    page.mouse.up()
    settle(page)
    for positions in both(page, "positions"):
        assert positions[2] == pytest.approx([0.3, -0.6], abs=0.01)
    assert page.get_by_role("heading", name="navigation_0 in B").is_visible()


def test_a_victim_moves_in_both_where_both_have_it(page: Page) -> None:
    victim = both(page, "victims")[0][0]
    form = page.locator("#victim-place")
    form.get_by_label("Victim").select_option(f"slot {victim['slot']}")
    form.get_by_label("x").fill("0.8")
    form.get_by_label("y").fill("-0.8")
    form.get_by_role("button", name="Put it there").click()
    settle(page)
    for victims in both(page, "victims"):
        assert (victims[0]["x"], victims[0]["y"]) == (0.8, -0.8)


def test_one_robot_is_steered_in_both(page: Page) -> None:
    page.evaluate("play.reach({ do: 'move_robot', robot: 0, x: 0, y: 0.9 })")
    settle(page)
    page.keyboard.press("s")
    page.keyboard.down("ArrowLeft")
    until(page, "play.arenas.every(({ run }) => run.now.positions[0][0] < -0.3)")
    page.get_by_role("checkbox", name="apply to both").uncheck()
    page.keyboard.up("ArrowLeft")
    page.keyboard.press("Space")
    settle(page)
    assert page.evaluate("play.arenas.map(({ steered }) => steered)") == [0, 0]
    actions = "play.arenas.map(({ link }) => link.transport.sessions.get(link.session).actions[0])"
    assert page.evaluate(actions) == [0, 0], "both stand still"


def test_its_counters_are_those_of_the_measures(page: Page) -> None:
    scenario = Scenario.preset("mixed")
    found = page.evaluate(STEPS, 400)
    settle(page)
    captions = page.locator("#panes output").all_inner_texts()
    for rescues, caption in zip(found, captions, strict=True):
        kind = [(name, np.int64) for name in ("task", "helper_0", "helper_1")]
        events = np.array([(one["task"], *one["helpers"]) for one in rescues], kind)
        counts = [list(one.values()) for one in count_cooperation(events, scenario).values()]
        imbalance = np.mean([abs(one[0] / sum(one) - 0.5) for one in counts])
        assert caption == f"{len(rescues)} rescues · imbalance {imbalance:.2f}"
        assert len(rescues) > 10


def test_another_policy_is_chosen_above_its_arena(page: Page) -> None:
    page.get_by_role("combobox", name="Policy of B").select_option("random")
    settle(page)
    assert both(page, "policy") == ["mixed", "random"]
    assert page.get_by_role("combobox", name="Policy", exact=True).is_hidden()
    assert page.locator("#which button").all_inner_texts() == ["A: mixed", "B: random"]


@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_it_plays_without_a_word_in_the_console(
    browser: Browser, file: Path, size: tuple[int, int]
) -> None:
    """Beside each other where there is room, else one above the other."""
    with visit(browser, file, size) as seen:
        page, said = seen.page, []
        page.on("console", lambda message: said.append(message.text))
        ready(page)
        page.evaluate(STEPS, 10_000 if size == WIDE else 300)
        settle(page)
        assert both(page, "step") == ([10_000] * 2 if size == WIDE else [300] * 2)
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        (ax, ay), (bx, by) = (
            page.get_by_role("img", name=name).evaluate(
                "(one) => [one.getBoundingClientRect().left, one.getBoundingClientRect().top]"
            )
            for name in ("Arena A", "Arena B")
        )
        assert (ay == by and bx > ax + 300) if size == WIDE else (ax == bx and by > ay + 250)
        assert not said


def test_a_server_shows_two_arenas_too(browser: Browser) -> None:
    with (
        played(scripted_world(), beside="greedy") as server,
        visit(browser, server.address) as seen,
    ):
        page = seen.page
        until(page, "Boolean(window.play)")
        page.get_by_role("button", name="Pause").click()
        settle(page)
        page.keyboard.press(".")
        settle(page)
        first, second = both(page, "step")
        assert first == second > 0
        assert both(page, "policy") == ["hungarian", "greedy"]
        for _ in range(5):  # more than may be open at a time
            page.reload()
            until(page, "Boolean(window.play)")


@pytest.mark.long
@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_everybody_can_use_it(browser: Browser, file: Path, size: tuple[int, int]) -> None:
    with visit(browser, file, size) as seen:
        ready(seen.page)
        for summary in seen.page.locator("summary").all():
            summary.click()
        assert not Visit(seen.page).serious_faults()
