"""The page of `innerattn play` in a real browser, with a real mouse, keys and fingers."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import PHONE, WIDE, Visit, opened_browser, until, visit
from fresh_run import make_run, run_config
from played import played, scripted_world
from playwright.sync_api import Browser, Page

from innerattn.config import Scenario
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.evaluate.trained import load_trained
from innerattn.policies import scripted_policy
from innerattn.report.worlds import worlds_document

HOSTILE = "</script><img src=x onerror='window.struck=1'>"

# What the others give to the last robot now, a mean over heads.
RECEIVED = """[0, 1, 2].map((other) => play.run.now.attention.reduce(
  (sum, head) => sum + head[other][3], 0) / play.run.heads)"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], InteractiveWorld]:
    """Makes worlds in which a run with attention acts, or scripts."""
    run = make_run(tmp_path_factory.mktemp("runs") / "mine", run_config("td-inner"))

    def make() -> InteractiveWorld:
        config, policy = load_trained(run)
        scenario = endless(config.scenario)
        scripts = {name: scripted_policy(name, scenario) for name in ("greedy", "hungarian")}
        return InteractiveWorld(scenario, {"mine": policy, **scripts}, 7)

    return make


def ready(page: Page, *, paused: bool = True) -> None:
    until(page, "Boolean(window.play)")
    if paused:
        page.get_by_role("button", name="Pause").click()
        settle(page)


def settle(page: Page) -> None:
    """Wait for answers that are under way, and for what they show."""
    until(page, "!play.link.busy && !play.movesNow && !play.stale")


def canvas_point(page: Page, expression: str) -> tuple[float, float]:
    """A point of the arena on the screen; the expression gives metres."""
    x, y = page.evaluate(f"play.scene.at(...{expression})")
    box = page.locator("#arena").bounding_box()
    assert box is not None
    return box["x"] + x, box["y"] + y


def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    for part in (0.3, 0.7, 1.0):
        page.mouse.move(*(a + part * (b - a) for a, b in zip(start, end, strict=True)))
    page.mouse.up()
    settle(page)


def state(page: Page) -> Any:
    return page.evaluate("play.run.now")


def arrange(page: Page) -> None:
    """Robots and victims where a test knows them, however long the team acted before its pause."""
    for robot in range(4):
        move = f"do: 'move_robot', robot: {robot}, x: {-0.9 + 0.4 * robot}, y: 0.9"
        page.evaluate(f"play.send({{ {move} }})")
    for place, one in enumerate(state(page)["victims"]):
        move = f"do: 'move_victim', slot: {one['slot']}, x: -0.7, y: {-0.8 + 0.4 * place}"
        page.evaluate(f"play.send({{ {move} }})")
    settle(page)


def test_it_runs_pauses_and_steps(browser: Browser, team: Any) -> None:
    with played(team) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page, paused=False)
        until(page, "play.run.last >= 3")
        page.keyboard.press("Space")
        settle(page)
        at = state(page)["step"]
        page.wait_for_timeout(250)
        assert state(page)["step"] == at
        page.keyboard.press(".")
        settle(page)
        assert state(page)["step"] == at + 1
        page.get_by_role("button", name="Step", exact=True).click()
        settle(page)
        assert state(page)["step"] == at + 2
        assert page.locator("#clock").inner_text().startswith(f"{(at + 2) / 10:.1f} s")
        page.keyboard.press("+")
        assert page.get_by_role("combobox", name="Speed").input_value() == "1"
        page.keyboard.press("n")
        settle(page)
        assert (state(page)["episode"], state(page)["step"]) == (1, 0)


def test_a_dragged_robot_is_where_it_was_dropped(browser: Browser, team: Any) -> None:
    with played(team) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        drag(
            page, canvas_point(page, "play.run.now.positions[2]"), canvas_point(page, "[0.3, -0.6]")
        )
        found = state(page)
        assert found["positions"][2] == pytest.approx([0.3, -0.6], abs=0.01)
        assert found["velocities"][2] == [0, 0]
        assert page.evaluate("play.look.robot") == 2
        assert page.evaluate("play.run.place(0, play.run.last, 2)") == found["positions"][2]
        drag(page, canvas_point(page, "play.run.now.positions[2]"), canvas_point(page, "[7, 0]"))
        assert state(page)["positions"][2][0] == pytest.approx(0.95, abs=2e-4), "inside the wall"
        assert page.locator("#problem").is_hidden()


def test_victims_are_dragged_and_added(browser: Browser) -> None:
    make = scripted_world(Scenario.preset("mixed").replace(max_victims=4))
    with played(make) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        arrange(page)
        drag(page, canvas_point(page, "[-0.7, -0.8]"), canvas_point(page, "[-0.2, 0.15]"))
        victims = state(page)["victims"]
        assert [victims[0]["x"], victims[0]["y"]] == pytest.approx([-0.2, 0.15], abs=0.01)
        page.get_by_role("combobox", name="Task of the victim to add").select_option(label="task_2")
        assert page.get_by_label("add a victim of").is_checked()
        before = len(victims)
        for place in range(4 - before):
            page.mouse.click(*canvas_point(page, f"[0.7, {-0.8 + 0.25 * place}]"))
            settle(page)
        victims = state(page)["victims"]
        assert [one["task"] for one in victims[before:]] == [1] * (4 - before)
        assert page.get_by_text("All 4 places are taken").is_visible()
        page.mouse.click(*canvas_point(page, "[0.7, 0.7]"))
        page.get_by_role("alert").get_by_text("All 4 places are taken").wait_for()


def test_a_broken_motor_slows_a_robot(browser: Browser) -> None:
    def driven(page: Page) -> float:
        """How far the robot comes that somebody drives to the right for ten steps."""
        page.evaluate("play.send({ do: 'move_robot', robot: 0, x: -0.9, y: 0.9 })")
        page.evaluate("play.send({ do: 'steer', robot: 0, x: 1, y: 0 })")
        for _ in range(10):
            page.get_by_role("button", name="Step", exact=True).click()
        settle(page)
        return float(state(page)["positions"][0][0]) + 0.9

    with played(scripted_world()) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        healthy = driven(page)
        page.get_by_role("button", name="Break motor").click()
        settle(page)
        assert (
            page.get_by_role("button", name="Break motor").get_attribute("aria-pressed") == "true"
        )
        assert page.locator("#events").get_by_text("fault: food_0, motor gain").is_visible()
        assert 0.0 < driven(page) < 0.4 * healthy
        page.get_by_role("button", name="Break motor").click()
        settle(page)
        assert state(page)["faults"][0] == {}
        assert driven(page) == pytest.approx(healthy, abs=1e-3)
        until(page, "document.querySelectorAll('.chart .fault').length === 1")
        (mark,) = page.locator(".chart .fault").all()
        assert mark.locator("title").text_content() == "food_0: motor gain 20 %"
        assert mark.locator("polygon").count() == 2, "it began and has ended"


def test_a_robot_is_blinded_and_taken_out_and_comes_back(browser: Browser) -> None:
    with played(scripted_world()) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        page.keyboard.press("r")
        page.evaluate("play.send({ do: 'move_robot', robot: 1, x: 0.9, y: 0.9 })")
        page.keyboard.press("b")
        page.keyboard.press("o")
        settle(page)
        assert state(page)["faults"][1] == {"blackout": 1, "unavailable": 1}
        assert page.evaluate("play.run.isAway(0, play.run.last, 1)")
        assert "Nobody offers" not in page.locator("#now").inner_text(), "food_0 offers food"
        page.evaluate("play.send({ do: 'faults', robot: 0, values: { unavailable: 1 } })")
        settle(page)
        assert "Nobody offers food now: victims of task_" in page.locator("#now").inner_text()
        before = state(page)["positions"][1]
        for _ in range(4):
            page.keyboard.press(".")
        settle(page)
        assert state(page)["positions"][1] == pytest.approx(before, abs=0.02)
        page.get_by_text("All faults of this robot").click()
        page.get_by_label("motor gain").fill("0.5")
        page.get_by_label("motor gain").press("Tab")
        settle(page)
        assert state(page)["faults"][1]["motor_gain"] == 0.5
        page.get_by_role("button", name="Repair all").click()
        settle(page)
        assert state(page)["faults"][1] == {}


def test_one_robot_is_steered_by_keys_and_pushed(browser: Browser) -> None:
    with played(scripted_world()) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        page.evaluate("play.send({ do: 'move_robot', robot: 0, x: 0, y: 0.9 })")
        settle(page)
        page.keyboard.press("s")
        page.keyboard.down("ArrowLeft")
        until(page, "play.run.now.positions[0][0] < -0.3")
        page.keyboard.up("ArrowLeft")
        page.keyboard.press("Space")
        page.keyboard.press("s")
        settle(page)
        assert state(page)["steered"] is None
        at = state(page)["positions"][0]
        page.keyboard.press("ArrowRight")
        settle(page)
        assert state(page)["positions"][0] == pytest.approx([at[0] + 0.05, at[1]], abs=1e-4)
        page.keyboard.press("Shift+ArrowDown")
        settle(page)
        assert state(page)["velocities"][0] == [0, -1.5]
        page.get_by_role("radio", name="push").check()
        start = canvas_point(page, "play.run.now.positions[1]")
        drag(page, start, (start[0] + 60, start[1] - 30))
        vx, vy = state(page)["velocities"][1]
        assert 0 < vy < vx
        assert vx == pytest.approx(2 * vy, rel=0.05)


def test_a_rescue_is_told_once(browser: Browser) -> None:
    with played(scripted_world()) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        page.keyboard.press("n")
        settle(page)
        page.evaluate(
            "(async () => { do { await play.send({ do: 'step' }); } "
            "while (!play.run.now.rescues.length); })()"
        )
        settle(page)
        before = page.locator("#events li").count()
        page.evaluate("play.send({ do: 'steer', robot: 0 })")
        page.evaluate("play.send({ do: 'policy', name: 'greedy' })")
        settle(page)
        assert page.locator("#events li").count() == before > 0


def test_everything_is_reached_without_a_mouse(browser: Browser) -> None:
    with played(scripted_world()) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        robot = page.locator("#robot-place")
        robot.get_by_label("x").fill("-0.4")
        robot.get_by_label("y").fill("0.25")
        robot.get_by_label("y").press("Enter")
        settle(page)
        assert state(page)["positions"][0] == [-0.4, 0.25]
        victim = page.locator("#victim-place")
        slot = state(page)["victims"][-1]["slot"]
        victim.get_by_label("Victim").select_option(f"slot {slot}")
        victim.get_by_label("x").fill("0.9")
        victim.get_by_label("y").fill("-0.9")
        victim.get_by_role("button", name="Put it there").press("Enter")
        settle(page)
        placed = next(one for one in state(page)["victims"] if one["slot"] == slot)
        assert (placed["x"], placed["y"]) == (0.9, -0.9)
        robot.get_by_label("x").fill("3")
        robot.get_by_label("x").press("Enter")
        assert not robot.get_by_label("x").evaluate("(field) => field.validity.valid")
        assert state(page)["positions"][0] == [-0.4, 0.25]
        robot.get_by_label("x").fill("-0.4")
        before = state(page)["velocities"][0]
        page.get_by_role("button", name="Right").press("Enter")
        settle(page)
        assert state(page)["velocities"][0] == [before[0] + 1.5, before[1]]


def test_another_policy_acts_on_the_same_state(browser: Browser, team: Any) -> None:
    with played(team) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        before = state(page)
        assert before["attention"] is not None
        page.get_by_role("combobox", name="Policy").select_option("greedy")
        settle(page)
        after = state(page)
        assert (after["positions"], after["attention"]) == (before["positions"], None)
        assert page.get_by_text("This policy shows no attention.").is_visible()
        page.get_by_role("button", name="Step", exact=True).click()
        page.keyboard.press("p")
        page.keyboard.press("p")
        settle(page)
        assert state(page)["policy"] == "mine"
        assert "of food_0's attention" in page.locator("#robots li").nth(1).inner_text()
        until(page, "document.querySelectorAll('.chart').length === 2")


def test_who_still_attends_to_a_robot_that_is_out(browser: Browser, team: Any) -> None:
    with played(team) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        page.locator("#robots button").nth(3).click()
        page.get_by_role("button", name="Take out").click()
        page.get_by_role("combobox", name="Arrows").select_option("received")
        settle(page)
        shares = [f"{round(100 * share)} %" for share in page.evaluate(RECEIVED)]
        for robot, share in enumerate(shares):
            text = page.locator("#robots button").nth(robot).inner_text()
            assert text.endswith(f"gives medical_0 {share}")
        assert "attends most to medical_0, which is out (" in page.locator("#now").inner_text()
        page.get_by_role("button", name="Steer").click()
        settle(page)
        assert page.get_by_role("button", name="Let go").is_visible()


@pytest.mark.long
def test_two_browsers_play_apart_and_a_closed_page_gives_its_place_back(browser: Browser) -> None:
    with played(scripted_world()) as server, visit(browser, server.address) as one:
        ready(one.page)
        with visit(browser, server.address) as other:
            ready(other.page)
            one.page.evaluate("play.send({ do: 'move_robot', robot: 0, x: 0, y: 0 })")
            settle(one.page)
            at = state(other.page)["positions"][0]
            other.page.keyboard.press(".")
            settle(other.page)
            assert at != [0, 0]
            assert state(one.page)["positions"][0] == [0, 0]
            for _ in range(9):  # more than may be open at a time
                other.page.reload()
                ready(other.page)


@pytest.mark.long
def test_the_end_of_the_server_and_of_a_session_is_told(browser: Browser) -> None:
    with played(scripted_world()) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        page.evaluate("play.link.session = 'over'")
        page.keyboard.press(".")
        page.get_by_role("alert").get_by_text("this session has ended").wait_for()
        seen.problems.clear()  # the browser logs every refused request
        page.get_by_role("button", name="Begin again").click()
        ready(page)
        page.route("**/sessions/*", lambda route: route.abort())
        page.keyboard.press(".")
        page.get_by_role("alert").get_by_text("Is innerattn play still running?").wait_for()
        seen.problems.clear()
        page.unroute("**/sessions/*")


def lone(**fields: Any) -> Scenario:
    robot = {"name": "solo", "kind": "k", "abilities": ["food"], "max_speed_mps": 1, "mass_kg": 1}
    return Scenario(robots=[robot], tasks=[{"name": "t", "needs": ["food"]}], **fields)


@pytest.mark.parametrize(
    "scenario", [Scenario.preset("mixed-16"), lone(), lone(situation="single")], ids=str
)
def test_teams_of_every_size(browser: Browser, scenario: Scenario) -> None:
    with played(scripted_world(scenario)) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page, paused=False)
        page.get_by_label("arrows of all robots").check()
        until(page, "play.run.last >= 4")
        assert page.locator("#robots li").count() == scenario.num_robots


def test_mappo_has_no_attention(browser: Browser, tmp_path: Path) -> None:
    config, policy = load_trained(make_run(tmp_path / "run", run_config("mappo")))

    def make() -> InteractiveWorld:
        return InteractiveWorld(endless(config.scenario), {"mappo": policy}, 1)

    with played(make) as server, visit(browser, server.address) as seen:
        ready(seen.page, paused=False)
        until(seen.page, "play.run.last >= 2")
        assert seen.page.get_by_text("This policy shows no attention.").is_visible()


def test_hostile_and_foreign_names_are_text(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    def described(scenario: Scenario) -> dict[str, Any]:
        document = worlds_document(scenario)  # a scenario refuses such names
        robots = document["robots"]
        robots[0]["name"], robots[1]["name"], robots[2]["kind"] = (
            HOSTILE,
            "Ärztin 医者 🚑",
            "__proto__",
        )
        document["tasks"][0]["name"] = HOSTILE
        return document

    monkeypatch.setattr("innerattn.report.play.state.worlds_document", described)
    with played(scripted_world(), HOSTILE) as server, visit(browser, server.address) as seen:
        page = seen.page
        ready(page)
        assert page.get_by_role("heading", level=1).inner_text() == f"Play with {HOSTILE}"
        names = page.locator("#robots strong").all_inner_texts()
        assert names[:2] == [HOSTILE, "Ärztin 医者 🚑"]
        page.keyboard.press("o")
        page.keyboard.press(".")
        settle(page)
        assert page.locator("img").count() == 0
        assert page.evaluate("window.struck") is None


def test_a_finger_drags_a_robot(browser: Browser) -> None:
    with (
        played(scripted_world()) as server,
        visit(browser, server.address, PHONE, has_touch=True, is_mobile=True) as seen,
    ):
        page = seen.page
        ready(page)
        page.locator("#arena").scroll_into_view_if_needed()
        touches = page.context.new_cdp_session(page)
        path = [canvas_point(page, "play.run.now.positions[3]"), canvas_point(page, "[0.2, 0.4]")]
        for kind, place in (("touchStart", path[0]), ("touchMove", path[1]), ("touchEnd", None)):
            points = [] if place is None else [{"x": place[0], "y": place[1]}]
            touches.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        settle(page)
        assert state(page)["positions"][3] == pytest.approx([0.2, 0.4], abs=0.02)


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_everybody_can_use_it(
    browser: Browser, team: Any, size: tuple[int, int], theme: str
) -> None:
    with played(team) as server, visit(browser, server.address, size, theme) as seen:
        page = seen.page
        ready(page)
        page.keyboard.press("o")
        for _ in range(4):
            page.keyboard.press(".")
        settle(page)
        for summary in page.locator("summary").all():
            summary.click()
        assert not Visit(page).serious_faults()
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        assert page.evaluate("document.documentElement.dataset.theme") == theme
