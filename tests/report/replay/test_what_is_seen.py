"""What a person sees in a replay: labels, arrows, attention received, faults, and a phone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PHONE, WIDE, opened_browser, until, visit
from playwright.sync_api import Browser, Page
from watched import watched

from innerattn.config import Battery, Scenario
from innerattn.report.replay.page import replay_page

# Draws many moments; gives the texts that cover a robot, and the badges drawn over robots.
COVERING = """() => {
  const scene = replay.scenes[0], found = [];
  let robotsAreDrawn = false, texts = 0;
  const { write, drawNeed, drawRobot } = scene.constructor.prototype;
  scene.write = function (text, x, y, bold) {
    write.call(this, text, x, y, bold);
    const half = this.context.measureText(text).width / 2;
    texts += 1;
    this.worlds.robots.forEach((one) => {
      const [px, py] = this.spots[one.index], up = y - 0.7 * this.letters;
      const dx = Math.max(Math.abs(px - x) - half, 0), dy = Math.max(up - py, py - y, 0);
      if (Math.hypot(dx, dy) < one.radius_m * this.scale) found.push(`${text} over ${one.name}`);
    });
  };
  scene.drawNeed = function (...all) {
    drawNeed.apply(this, all);
    if (robotsAreDrawn) found.push("a badge over robots");
  };
  scene.drawRobot = function (...all) {
    drawRobot.apply(this, all);
    robotsAreDrawn = true;
  };
  for (let episode = 0; episode < replay.run.episodes; episode++) {
    for (let step = 0; step < replay.run.lengths[episode]; step += 0.5) {
      robotsAreDrawn = false;
      scene.draw(episode, step, { ...replay.look, all: true, robot: step % 4 | 0 }, replay.paint);
    }
  }
  return [texts, [...new Set(found)]];
}"""
# The pairs of robots between which arrows are drawn now.
ARROWS = """() => {
  const scene = replay.scenes[0], found = [];
  scene.arrow = (from, to) => {
    found.push([from.index, to.index]);
    return [];
  };
  replay.draw();
  delete scene.arrow;
  return found;
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


def written(folder: Path, records: dict[str, Any]) -> Path:
    path = folder / "replay.html"
    path.write_text(replay_page(list(records.values()), list(records)), "utf-8")
    return path


def ready(page: Page) -> None:
    until(page, "Boolean(window.replay)")


@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_no_text_or_badge_covers_a_robot(
    browser: Browser, tmp_path: Path, size: tuple[int, int]
) -> None:
    crowded = Scenario.preset("mixed-8").replace(arena_half_width_m=0.8, max_victims=4)
    path = written(tmp_path, {"a": watched(crowded, episodes=3)})
    with visit(browser, path, size) as seen:
        ready(seen.page)
        texts, covering = seen.page.evaluate(COVERING)
        assert texts > 500
        assert covering == []


def test_of_sixteen_robots_the_strongest_arrows_are_drawn(browser: Browser, tmp_path: Path) -> None:
    record = watched(Scenario.preset("mixed-16"), episodes=1)
    with visit(browser, written(tmp_path, {"a": record})) as seen:
        page = seen.page
        ready(page)
        assert page.get_by_label("weight at least").is_hidden()
        page.get_by_label("arrows of all robots").check()
        weights = np.rint(record.steps["attention"][0, 0] * 255).mean(0) / 255
        strong = {(int(a), int(b)) for a, b in zip(*np.nonzero(weights >= 0.14), strict=True)}
        drawn = page.evaluate(ARROWS)
        assert {tuple(pair) for pair in drawn} == strong
        assert 0 < len(drawn) < 60
        assert page.locator("#least-text").inner_text() == "14 %"
        page.get_by_label("weight at least").fill("30")
        assert page.locator("#least-text").inner_text() == "30 %"
        few = page.evaluate(ARROWS)
        assert len(few) == (weights >= 0.3).sum() < len(drawn)
        page.get_by_label("weight at least").fill("0")
        assert len(page.evaluate(ARROWS)) > len(drawn)


# The robots whose disc is drawn, and whether any trail comes from where none was.
DRAWN = """(step) => {
  const scene = replay.scenes[0], found = [];
  const { context } = scene, arc = context.arc;
  scene.drawRobot = function (robot) {
    context.arc = (x, ...rest) => {
      if (!Number.isNaN(x)) found.push(robot.index);
      arc.call(context, x, ...rest);
    };
    scene.constructor.prototype.drawRobot.call(this, robot);
    delete context.arc;
  };
  scene.draw(0, step, { ...replay.look, robot: -1, trails: true, all: true }, replay.paint);
  delete scene.drawRobot;
  return [...new Set(found)];
}"""


def test_robots_that_left_are_not_drawn(browser: Browser, tmp_path: Path) -> None:
    faults = [
        {"robot": "medical_0", "kind": "unavailable", "value": 1.0, "duration_steps": 3},
        {"robot": "food_1", "kind": "unavailable", "value": 1.0, "onset_step": 5},
    ]
    scenario = Scenario.preset("mixed").replace(faults=faults, unavailable_robots="leave")
    record = watched(scenario, episodes=1)
    with visit(browser, written(tmp_path, {"a": record})) as seen:
        page = seen.page
        ready(page)
        assert page.evaluate(DRAWN, 1.5) == [0, 1, 2]
        assert page.evaluate(DRAWN, 4) == [0, 1, 2, 3]
        assert page.evaluate(DRAWN, 6) == [0, 2, 3]
        x, y = page.evaluate("() => replay.scenes[0].at(...replay.run.place(0, 6, 1))")
        assert page.evaluate("([x, y]) => replay.scenes[0].robotAt(x, y, 0, 6)", [x, y]) != 1
        assert page.evaluate("([x, y]) => replay.scenes[0].robotAt(x, y, 0, 4)", [x, y]) == 1


def test_charges_of_batteries_are_shown(browser: Browser, tmp_path: Path) -> None:
    plain = Scenario.preset("mixed")
    battery = Battery(capacity_j=4.0, per_m_j=0.0, idle_w=10.0)
    robots = (plain.robots[0].replace(battery=battery), *plain.robots[1:])
    record = watched(plain.replace(robots=robots), episodes=1)
    with visit(browser, written(tmp_path, {"a": record})) as seen:
        page = seen.page
        ready(page)
        notes = page.locator("#robots button")
        slider = page.get_by_role("slider", name="Step")
        slider.fill("3")
        assert "battery 25 %" in notes.nth(0).inner_text()
        assert "battery" not in notes.nth(1).inner_text()
        slider.fill("5")
        assert "battery empty" in notes.nth(0).inner_text()


def test_loads_are_shown(browser: Browser, tmp_path: Path) -> None:
    plain = Scenario.preset("mixed").replace(rescue_radius_m=3.0)
    depots = [{"position_m": (0.9, 0.9), "radius_m": 0.1}]
    robots = (plain.robots[0].replace(load=3), *plain.robots[1:])
    record = watched(plain.replace(robots=robots, depots=depots), episodes=1)
    used_up = int((record.steps["load"][0, :, 0] == 0.0).argmax())
    assert 0 < used_up < record.lengths[0]
    with visit(browser, written(tmp_path, {"a": record})) as seen:
        page = seen.page
        ready(page)
        notes = page.locator("#robots button")
        slider = page.get_by_role("slider", name="Step")
        slider.fill("0")
        assert "load 3 of 3" in notes.nth(0).inner_text()
        assert "load" not in notes.nth(1).inner_text()
        slider.fill(str(used_up - 1))
        assert "load 1 of 3" in notes.nth(0).inner_text()
        slider.fill(str(used_up))
        assert "load used up" in notes.nth(0).inner_text()
        assert "a depot that refills loads" in (page.locator("body").text_content() or "")


def test_attention_that_a_robot_receives(browser: Browser, tmp_path: Path) -> None:
    faults = [{"robot": "medical_0", "kind": "unavailable", "value": 1.0, "onset_step": 3}]
    record = watched(Scenario.preset("mixed").replace(faults=faults), episodes=1)
    with visit(browser, written(tmp_path, {"a": record})) as seen:
        page = seen.page
        ready(page)
        page.locator("#robots button").nth(3).click()
        page.get_by_role("combobox", name="Head").select_option(label="2")
        page.get_by_role("slider", name="Step").fill("6")
        assert {one for one, _ in page.evaluate(ARROWS)} == {3}
        page.keyboard.press("g")
        assert page.get_by_role("combobox", name="Arrows").input_value() == "received"
        arrows = page.evaluate(ARROWS)
        assert {tuple(pair) for pair in arrows} <= {(0, 3), (1, 3), (2, 3)}
        weights = np.rint(record.steps["attention"][0, 6, 1, :, 3] * 255) / 255
        shares = [f"{round(100 * float(weight))} %" for weight in weights]
        for robot in range(3):
            text = page.locator("#robots button").nth(robot).inner_text()
            assert text.endswith(f"gives medical_0 {shares[robot]}")
        heading = page.locator(".chart h2").first.inner_text()
        assert heading.startswith("Attention received by medical_0")
        assert "from each teammate, head 2" in heading
        best = int(np.argmax(weights[:3]))
        assert page.locator("#now").inner_text() == (
            f"Of all teammates {record.robot_names[best]} attends most to medical_0, which is out "
            f"({shares[best]}; even: 33 %)."
        )
        page.get_by_role("combobox", name="Arrows").select_option("given")
        assert page.locator(".chart h2").first.inner_text().startswith("Attention of medical_0")


def test_faults_are_marked_on_every_chart(browser: Browser, tmp_path: Path) -> None:
    faults = [{"robot": "food_0", "kind": "motor_gain", "value": 0.5, "onset_step": 5}]
    record = watched(Scenario.preset("mixed").replace(faults=faults), episodes=1)
    with visit(browser, written(tmp_path, {"a": record})) as seen:
        page = seen.page
        ready(page)
        charts = page.locator(".chart svg")
        assert charts.count() == 3
        for chart in charts.all():
            (mark,) = chart.locator(".fault").all()
            assert mark.locator("title").text_content() == "food_0: motor gain 50 %"
            assert chart.get_by_text("food_0: motor gain 50 %").count() == 2  # and in words
            line = mark.locator("rect").bounding_box()
            whole = chart.bounding_box()
            assert line is not None
            assert whole is not None
            start = whole["x"] + (40 + (whole["width"] - 158) * 5 / 24)
            assert line["x"] == pytest.approx(start, abs=1)
            assert line["x"] + line["width"] == pytest.approx(
                whole["x"] + whole["width"] - 118, abs=1
            )


def test_counts_of_two_policies_stand_side_by_side(browser: Browser, tmp_path: Path) -> None:
    records = {"h": watched(), "r": watched(script="random")}
    with visit(browser, written(tmp_path, records)) as seen:
        ready(seen.page)
        for episode in range(6):
            option = seen.page.locator(f"#episode option[value='{episode}']")
            parts = (option.text_content() or "").split(" · ")
            counts = [int(record.rescue_counts()[episode]) for record in records.values()]
            assert parts[1] == f"{counts[0]} : {counts[1]} rescues"
            own = seen.page.evaluate(f"replay.runs.map((run) => run.handoffs[{episode}].length)")
            expected = [f"{own[0]} : {own[1]} handoffs"] if any(own) else []
            assert parts[2:] == expected


def test_on_a_phone_policies_are_tabs_and_play_stays_in_sight(
    browser: Browser, tmp_path: Path
) -> None:
    records = {"first": watched(), "second": watched(script="greedy", heads=0)}
    with visit(browser, written(tmp_path, records), PHONE) as seen:
        page = seen.page
        ready(page)
        canvases = page.locator("canvas")
        for index, name in ((1, "second"), (0, "first")):
            tab = page.get_by_role("button", name=name)
            tab.click()
            assert tab.get_attribute("aria-pressed") == "true"
            assert [canvas.is_visible() for canvas in canvases.all()] == [index == 0, index == 1]
            box = canvases.nth(index).bounding_box()
            assert box is not None
            assert page.evaluate(f"replay.scenes[{index}].side") == pytest.approx(
                box["width"], abs=1
            )
        end = page.evaluate("document.documentElement.scrollHeight")
        for place in range(0, end, 300):
            page.evaluate(f"scrollTo(0, {place})")
            play = page.get_by_role("button", name="Play").bounding_box()
            assert play is not None
            assert 0 <= play["y"] < PHONE[1] - 40


def test_the_legend_names_every_mark(browser: Browser, tmp_path: Path) -> None:
    with visit(browser, written(tmp_path, {"a": watched(episodes=1)})) as seen:
        ready(seen.page)
        text = seen.page.locator("#legend").text_content() or ""
        for mark in ("velocity", "trail", "filled small disc", "chosen robot", "arrow", "out"):
            assert mark in text
        button = seen.page.get_by_role("button", name="Dark")
        assert button.get_attribute("aria-pressed") == "false"
        button.click()
        assert button.get_attribute("aria-pressed") == "true"
        assert seen.page.evaluate("document.documentElement.dataset.theme") == "dark"
