"""The page of a schedule in a real browser: what a person sees and does."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import PHONE, WIDE, opened_browser, until, visit
from playwright.sync_api import Browser, Page

from innerattn.config.instances import Instance, named_instance
from innerattn.policies.scripted.planner import schedule_by
from innerattn.report.schedule import schedule_page

HOSTILE = "</script><img src=x onerror='window.struck=1'>"
RAL = named_instance("ral:ral_03")
GREEDY = schedule_by("greedy", RAL, 0.0, 0)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of the plain planner, whose schedule is always the same."""
    path = tmp_path_factory.mktemp("one") / "replay.html"
    path.write_text(schedule_page(RAL, GREEDY, "greedy"), "utf-8")
    return path


def ready(page: Page) -> None:
    until(page, "Boolean(window.replay)")


def clock(page: Page) -> str:
    return page.locator("#clock").inner_text()


def time(page: Page) -> float:
    return float(page.evaluate("replay.time"))


def pixels(page: Page) -> str:
    return str(page.evaluate("document.querySelector('#map').toDataURL()"))


def test_it_plays_to_the_end_and_pauses(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        assert page.get_by_role("heading", level=1).inner_text() == (
            "Schedule of ral_03, planned by greedy"
        )
        published = RAL.makespan_milp_600s
        assert published is not None
        assert page.locator("#headline").inner_text() == (
            f"makespan {GREEDY.makespan:.2f}, published {published:.2f}, "
            f"ratio {GREEDY.makespan / published:.3f}"
        )
        assert clock(page) == f"0.00 of {GREEDY.makespan:.2f} · 0 of 20 tasks done"
        first = pixels(page)
        page.get_by_role("button", name="Play").click()
        until(page, "replay.time > 0.3")
        page.get_by_role("button", name="Pause").click()
        at = time(page)
        assert pixels(page) != first
        page.wait_for_timeout(150)
        assert time(page) == at
        page.get_by_role("slider", name="Time").fill("990")
        page.get_by_role("combobox", name="Speed").select_option(label="4×")
        page.keyboard.press("Space")
        until(page, "!replay.playing && replay.time === replay.course.makespan")
        assert clock(page).endswith("20 of 20 tasks done")


def test_the_slider_at_its_end_shows_that_all_is_done(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        slider = page.get_by_role("slider", name="Time")
        slider.fill("1000")
        end = f"{GREEDY.makespan:.2f}"
        assert clock(page) == f"{end} of {end} · 20 of 20 tasks done"
        assert slider.get_attribute("aria-valuetext") == clock(page)
        assert page.locator("#now").inner_text() == "Robots: 15 are at depots. Tasks: 20 done."
        assert Counter(page.locator("#tasks output").all_inner_texts()) == {"done": 20}


def test_a_moment_is_that_of_the_schedule(browser: Browser, one: Path) -> None:
    """States of tasks, and robots that stand where they wait, work or rest."""
    ends = [start + task.duration for start, task in zip(GREEDY.starts, RAL.tasks, strict=True)]
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        for share in range(0, 1001, 111):
            page.get_by_role("slider", name="Time").fill(str(share))
            now = share / 1000 * GREEDY.makespan
            assert time(page) == pytest.approx(now)
            states = Counter(page.locator("#tasks output").all_inner_texts())
            assert states["done"] == sum(end <= now for end in ends)
            assert states["waiting"] == sum(start > now for start in GREEDY.starts)
            away = page.evaluate(
                """() => replay.course.robots.map((robot) => {
                  const { map, time, course } = replay, span = course.spanAt(robot, time);
                  if (span?.what === "drive" || span?.what === "home") return null;
                  const place = span ? course.tasks[span.task].position : robot.depot;
                  const [x, y] = map.spot(robot, time), [toX, toY] = map.at(place);
                  return [span ? span.task : -1, Math.hypot(x - toX, y - toY) / map.radius];
                })"""
            )
            for robot, found in enumerate(away):
                if found is None:
                    continue
                task, radii = found
                assert radii < 3
                if task < 0:
                    assert now >= GREEDY.returns[robot] - 1e-9
                else:
                    assert task in GREEDY.tasks[robot]
                    assert now <= ends[task] + 1e-9


def test_a_robot_drives_straight_at_constant_speed(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        drives = page.evaluate(
            """() => replay.course.robots.flatMap((robot) => robot.spans.flatMap((span) => {
              if (span.what !== "drive" && span.what !== "home") return [];
              const { begin, end } = span;
              const at = (share) => replay.map.spot(robot, begin + share * (end - begin));
              return [[at(0), at(0.25), at(0.5), at(1 - 1e-9)]];
            }))"""
        )
        assert len(drives) > 60
        for start, early, middle, end in drives:
            for axis in (0, 1):
                way = end[axis] - start[axis]
                assert early[axis] == pytest.approx(start[axis] + way / 4, abs=1e-3)
                assert middle[axis] == pytest.approx(start[axis] + way / 2, abs=1e-3)
        assert max(abs(end[0] - start[0]) for start, _, _, end in drives) > 200


def test_the_legend_names_kinds_states_and_bars(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        page.locator("summary").first.click()
        rows = page.locator("#legend li").all_inner_texts()
        assert rows[:5] == [f"robot with skill {skill}" for skill in range(5)]
        assert [row.split(":")[0] for row in rows if " bar:" in row] == (
            ["pale bar", "hatched bar", "dashed bar"]
        )
        assert sum(row.startswith("task ") for row in rows) == 3


def test_keys_chart_and_list_move_the_time(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        page.locator("body").click(position={"x": 3, "y": 3})
        page.keyboard.press(".")
        assert time(page) == min(GREEDY.starts)
        page.keyboard.press(",")
        assert time(page) == 0
        page.keyboard.press("ArrowRight")
        assert time(page) == pytest.approx(GREEDY.makespan / 100)
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("+")
        assert page.get_by_role("combobox", name="Speed").input_value() == "2"
        x = page.evaluate("replay.gantt.x(replay.course.makespan / 2)")
        page.locator("#gantt canvas").click(position={"x": x, "y": 5 * 22 + 11})
        assert time(page) == pytest.approx(GREEDY.makespan / 2, rel=0.01)
        assert page.locator("#span").inner_text().startswith("robot 5 ")
        cursor = page.locator("#gantt .cursor").bounding_box()
        chart = page.locator("#gantt").bounding_box()
        assert cursor is not None
        assert chart is not None
        assert cursor["x"] + 1 - chart["x"] == pytest.approx(x, abs=2)
        page.locator("#tasks button").last.click()
        assert time(page) == max(GREEDY.starts)
        page.keyboard.press("Space")  # presses the button that has the focus
        assert not page.evaluate("replay.playing")


def test_hostile_names_are_text_and_nothing_to_do_takes_no_time(
    browser: Browser, tmp_path: Path
) -> None:
    spot = {"position": (7.0, 7.0), "skills": [0], "duration": 0.0}
    robot = {"depot": (7.0, 7.0), "skills": [0]}
    table = {"name": "still", "speed": 1.0, "robots": [robot], "tasks": [spot]}
    instance = Instance.model_validate(table)
    path = tmp_path / "naïve 🚑.html"
    path.write_text(
        schedule_page(instance, schedule_by("greedy", instance, 0, 0), HOSTILE), "utf-8"
    )
    with visit(browser, path) as seen:
        page = seen.page
        ready(page)
        assert HOSTILE in page.get_by_role("heading", level=1).inner_text()
        assert page.locator("#headline").inner_text() == "makespan 0.00"
        page.get_by_role("button", name="Play").click()
        assert clock(page) == "0.00 of 0.00 · 1 of 1 task done"
        assert page.locator("img").count() == 0
        assert page.evaluate("window.struck") is None


def test_a_damaged_page_says_so(browser: Browser, one: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.html"
    path.write_text(one.read_text("utf-8").replace('"robots":[', '"robots":0,"x":[', 1), "utf-8")
    with visit(browser, path) as seen:
        seen.page.get_by_text("This schedule cannot be shown").wait_for()


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_everybody_can_use_it(
    browser: Browser, one: Path, size: tuple[int, int], theme: str
) -> None:
    with visit(browser, one, size, theme) as seen:
        page = seen.page
        ready(page)
        page.get_by_role("slider", name="Time").fill("400")
        for summary in page.locator("summary").all():
            summary.click()
        assert not seen.serious_faults()
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        before = pixels(page)
        page.locator("#theme").click()
        assert pixels(page) != before
