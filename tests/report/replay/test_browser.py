"""The replay page in a real browser: what a person sees and does."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from browser import PHONE, WIDE, opened_browser, until, visit
from playwright.sync_api import Browser, Page
from watched import watched

from innerattn.config import Scenario
from innerattn.records.record import Record
from innerattn.report.replay.data import replay_document
from innerattn.report.replay.page import page_of, replay_page

HOSTILE = "</script><img src=x onerror='window.struck=1'>"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of one policy with attention."""
    return written(tmp_path_factory.mktemp("one"), watched(episodes=20))


def written(folder: Path, *records: Record, names: list[str] | None = None) -> Path:
    path = folder / "replay.html"
    names = names or [f"policy {index}" for index in range(len(records))]
    path.write_text(replay_page(records, names), "utf-8")
    return path


def ready(page: Page) -> None:
    until(page, "Boolean(window.replay)")


def step(page: Page) -> float:
    return float(page.evaluate("replay.step"))


def pixels(page: Page) -> str:
    return str(page.evaluate("document.querySelector('canvas').toDataURL()"))


def test_it_plays_to_the_end_and_pauses(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        first = pixels(page)
        page.get_by_role("button", name="Play").click()
        until(page, "replay.step > 1.5")
        page.get_by_role("button", name="Pause").click()
        at = step(page)
        assert pixels(page) != first
        page.wait_for_timeout(150)
        assert step(page) == at
        page.get_by_role("combobox", name="Speed").select_option(label="4×")
        page.keyboard.press("Space")
        until(page, "!replay.playing && replay.step === 24")
        assert page.locator("#clock").inner_text() == "step 25 of 25 · 2.4 s"


def test_it_scrubs_by_slider_keys_charts_and_events(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        page.get_by_role("slider", name="Step").fill("7")
        assert step(page) == 7
        page.keyboard.press("ArrowRight")
        assert step(page) == 8
        page.locator("body").click(position={"x": 3, "y": 3})
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("ArrowLeft")
        assert step(page) == 6
        page.keyboard.press(",")
        page.keyboard.press(".")
        events = page.evaluate("replay.events.events.map((one) => one.step)")
        assert step(page) in events
        page.locator("#events button").last.click()
        assert step(page) == events[-1]
        page.locator(".chart svg").first.click(position={"x": 42, "y": 40})
        assert step(page) == 0


def test_robot_head_and_arrows_change_what_is_drawn(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        page.locator("#robots button").nth(3).click()
        assert page.locator("#robots button").nth(3).get_attribute("aria-pressed") == "true"
        assert page.locator(".chart h2").first.inner_text().startswith("Attention of medical_0")
        mean = pixels(page)
        page.get_by_role("combobox", name="Head").select_option(label="3")
        head = pixels(page)
        page.get_by_label("arrows of all robots").check()
        everybody = pixels(page)
        assert len({mean, head, everybody}) == 3
        assert "head 3" in page.locator(".chart h2").first.inner_text()
        page.keyboard.press("h")
        assert page.get_by_role("combobox", name="Head").input_value() == "3"
        x, y = page.evaluate(
            "replay.scenes[0].at(...replay.run.place(replay.episode, replay.step, 1))"
        )
        page.locator("canvas").click(position={"x": x, "y": y})
        assert page.evaluate("replay.look.robot") == 1


def test_weights_on_the_page_are_those_of_the_record(browser: Browser, tmp_path: Path) -> None:
    record = watched(episodes=3)
    with visit(browser, written(tmp_path, record)) as seen:
        page = seen.page
        ready(page)
        page.get_by_role("combobox", name="Episode").select_option("2")
        page.locator("#robots button").nth(1).click()
        page.get_by_role("combobox", name="Head").select_option(label="1")
        page.get_by_role("slider", name="Step").fill("5")
        weights = record.steps["attention"][2, 5, 0, 1]
        text = page.locator("#robots button").nth(2).inner_text()
        assert f"{round(100 * round(float(weights[2]) * 255) / 255)} % of food_1's" in text
        x, y = page.evaluate("replay.run.place(2, 5, 1)")
        assert (x, y) == pytest.approx(record.steps["positions"][2, 5, 1].tolist(), abs=1e-4)


def test_the_attention_of_the_actor_stands_beside_that_of_the_critic(
    browser: Browser, tmp_path: Path
) -> None:
    both = watched(episodes=3, heads=4, actor_heads=2)
    critic = watched(episodes=3, heads=4)
    with visit(browser, written(tmp_path, both, critic, names=["both", "critic only"])) as seen:
        page = seen.page
        ready(page)
        page.get_by_role("combobox", name="Episode").select_option("2")
        page.get_by_role("slider", name="Step").fill("5")
        page.locator("#robots button").nth(1).click()
        page.get_by_role("combobox", name="Head").select_option(label="4")
        of_critic = pixels(page)
        page.get_by_role("combobox", name="Attention of the").select_option("actor")
        assert page.locator("#head option").all_inner_texts() == ["mean", "1", "2"]
        assert page.get_by_role("combobox", name="Head").input_value() == "-1"
        page.get_by_role("combobox", name="Head").select_option(label="2")
        assert pixels(page) != of_critic
        weight = round(float(both.steps["actor_attention"][2, 5, 1, 1, 2]) * 255) / 255
        text = page.locator("#robots button").nth(2).inner_text()
        assert f"{round(100 * weight)} % of food_1's" in text
        assert page.locator(".chart h2").first.inner_text().startswith("Attention of food_1")
        assert not seen.serious_faults()

        page.get_by_role("button", name="critic only").click()
        assert page.get_by_text("The actor of this policy has no attention.").is_visible()
        assert page.locator(".chart h2").first.inner_text().startswith("Reward")
        page.locator("body").click(position={"x": 3, "y": 3})
        page.keyboard.press("c")
        assert page.get_by_role("combobox", name="Attention of the").input_value() == "critic"
        assert page.locator(".chart h2").first.inner_text().startswith("Attention of food_1")
        assert page.locator("#head option").count() == 5


def test_attention_of_actors_alone_is_shown_without_a_choice(
    browser: Browser, tmp_path: Path
) -> None:
    record = watched(episodes=2, heads=0, actor_heads=2)
    with visit(browser, written(tmp_path, record)) as seen:
        page = seen.page
        ready(page)
        assert not page.locator("#whose-box").is_visible()
        assert page.locator(".chart h2").first.inner_text().startswith("Attention of")
        page.get_by_text("How to read this").click()
        assert page.get_by_text("sums up its teammates in order to act").is_visible()


def test_episodes_can_be_sorted(browser: Browser, one: Path) -> None:
    with visit(browser, one) as seen:
        page = seen.page
        ready(page)
        page.get_by_role("combobox", name="Sorted").select_option("rescues")
        counts = page.evaluate("replay.order.map((e) => replay.run.rescues[e].length)")
        assert counts == sorted(counts, reverse=True)
        page.get_by_role("combobox", name="Sorted").select_option("number")
        assert page.evaluate("replay.order") == list(range(20))
        assert page.get_by_role("button", name="Previous episode").is_disabled()
        page.get_by_role("combobox", name="Episode").select_option("19")
        assert page.get_by_role("button", name="Next episode").is_disabled()
        assert page.get_by_role("button", name="Previous episode").is_enabled()
        page.get_by_role("combobox", name="Episode").select_option("0")
        page.get_by_role("button", name="Next episode").click()
        assert page.get_by_role("combobox", name="Episode").input_value() == "1"
        page.keyboard.press("[")
        assert page.get_by_role("combobox", name="Episode").input_value() == "0"


def test_two_policies_side_by_side(browser: Browser, tmp_path: Path) -> None:
    records = watched(heads=0), watched(script="greedy")
    with visit(browser, written(tmp_path, *records, names=["h", "g"])) as seen:
        page = seen.page
        ready(page)
        assert page.locator("canvas").count() == 2
        assert page.locator("#which [aria-pressed=true]").inner_text() == "g"
        page.get_by_role("button", name="h", exact=True).click()
        assert page.get_by_text("This policy shows no attention.").is_visible()
        page.get_by_role("combobox", name="Sorted").select_option("difference")
        page.get_by_role("slider", name="Step").fill("24")
        episode = page.evaluate("replay.episode")
        for index, record in enumerate(records):
            count = int(record.rescue_counts()[episode])
            text = page.locator(".pane output").nth(index).inner_text()
            assert text == f"{count} rescue{'s' * (count != 1)}"


def test_episodes_that_end_at_different_steps(browser: Browser, tmp_path: Path) -> None:
    scenario = Scenario.preset("mixed").replace(end_when_rescued=1)
    records = watched(scenario), watched(scenario, script="random", heads=0)
    path = written(tmp_path, *records, names=["a", "b"])
    with visit(browser, path) as seen:
        page = seen.page
        ready(page)
        page.get_by_role("combobox", name="Sorted").select_option("number")
        for episode in range(3):
            page.get_by_role("combobox", name="Episode").select_option(str(episode))
            lengths = [int(record.lengths[episode]) for record in records]
            page.get_by_role("slider", name="Step").fill(str(max(lengths) - 1))
            assert page.locator("#clock").inner_text().startswith(f"step {lengths[0]} of ")
            rescue = page.evaluate("replay.events.events.find((one) => one.type === 'rescue').step")
            page.locator("#events button").last.click()
            slider = page.locator("#scrubber").bounding_box()
            mark = page.locator("#marks polygon").last.bounding_box()
            assert slider is not None
            assert mark is not None
            share = (mark["x"] + mark["width"] / 2 - slider["x"] - 8) / (slider["width"] - 16)
            assert share == pytest.approx(rescue / (max(lengths) - 1), abs=0.02)


def test_sixteen_robots_with_all_arrows_are_drawn(browser: Browser, tmp_path: Path) -> None:
    path = written(tmp_path, watched(Scenario.preset("mixed-16"), episodes=2))
    with visit(browser, path) as seen:
        page = seen.page
        ready(page)
        page.get_by_label("arrows of all robots").check()
        page.evaluate("replay.times.length = 0")
        page.get_by_role("button", name="Play").click()
        until(page, "replay.times.length > 20")


def few(**fields: Any) -> Scenario:
    """A lone robot, and victims that it can or cannot rescue by itself."""
    robot = {"name": "solo", "kind": "k", "abilities": ["food"], "max_speed_mps": 1, "mass_kg": 1}
    return Scenario(robots=[robot], tasks=[{"name": "t", "needs": ["food"]}], **fields)


def test_one_robot_without_teammates(browser: Browser, tmp_path: Path) -> None:
    with visit(browser, written(tmp_path, watched(few()))) as seen:
        ready(seen.page)
        assert seen.page.get_by_text("This policy shows no attention.").is_visible()
        seen.page.get_by_role("button", name="Play").click()
        until(seen.page, "replay.step > 2")


def test_a_run_in_which_nothing_happens(browser: Browser, tmp_path: Path) -> None:
    scenario = Scenario.preset("mixed").replace(max_victims=1, episode_steps=1)
    record = watched(scenario, script="random", episodes=1)
    assert not len(record.rescues)
    with visit(browser, written(tmp_path, record)) as seen:
        page = seen.page
        ready(page)
        assert page.get_by_text("Nothing happens in this episode.").is_visible()
        page.get_by_role("button", name="Play").click()
        page.get_by_role("button", name="Next event").click()
        assert step(page) == 0


def test_hostile_and_foreign_names_are_text(browser: Browser, tmp_path: Path) -> None:
    document = replay_document([watched(episodes=1)], [HOSTILE])
    robots = document["worlds"]["robots"]
    robots[0]["name"], robots[1]["name"], robots[2]["kind"] = HOSTILE, "Ärztin 医者 🚑", "__proto__"
    document["worlds"]["tasks"][0]["name"] = HOSTILE
    path = tmp_path / "naïve 🚑.html"
    path.write_text(page_of(document, [HOSTILE]), "utf-8")
    with visit(browser, path) as seen:
        page = seen.page
        ready(page)
        assert page.get_by_role("heading", level=1).inner_text() == f"Replay of {HOSTILE}"
        assert page.locator("#robots strong").all_inner_texts()[:2] == [HOSTILE, "Ärztin 医者 🚑"]
        page.get_by_role("button", name="Play").click()
        until(page, "replay.step > 1")
        assert page.locator("img").count() == 0
        assert page.evaluate("window.struck") is None


def test_a_damaged_page_says_so(browser: Browser, one: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.html"
    path.write_text(one.read_text("utf-8").replace('"data":"', '"data":"!', 1), "utf-8")
    with visit(browser, path) as seen:
        seen.page.get_by_text("This replay cannot be shown").wait_for()


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_everybody_can_use_it(
    browser: Browser, tmp_path: Path, size: tuple[int, int], theme: str
) -> None:
    faults = [{"robot": "food_0", "kind": "unavailable", "value": 1.0, "onset_step": 3}]
    scenario = Scenario.preset("mixed").replace(faults=faults)
    path = written(tmp_path, watched(scenario), watched(scenario, script="oracle", heads=0))
    with visit(browser, path, size, theme) as seen:
        page = seen.page
        ready(page)
        page.get_by_role("slider", name="Step").fill("5")
        for summary in page.locator("summary").all():
            summary.click()
        assert not seen.serious_faults()
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= size[0]
        assert page.evaluate("document.documentElement.dataset.theme") == theme


def test_layers_are_told_apart_and_explained(browser: Browser, tmp_path: Path) -> None:
    layered = Scenario.preset("air-ground")
    grounded = tuple(robot.replace(layer="ground") for robot in layered.robots)
    shown, legends = [], []
    for name, scenario in (("layered", layered), ("flat", layered.replace(robots=grounded))):
        record = watched(layered, episodes=2)
        (tmp_path / name).mkdir()
        with visit(browser, written(tmp_path / name, replace(record, scenario=scenario))) as seen:
            ready(seen.page)
            legends.append(seen.page.locator("#legend").text_content() or "")
            shown.append(pixels(seen.page))
            assert not seen.problems
    assert "a robot of layer air, which touches no robot of another layer" in legends[0]
    assert "an obstacle that robots of air pass" in legends[0]
    assert "layer" not in legends[1]
    assert "pass" not in legends[1]
    assert shown[0] != shown[1]


def test_robots_on_wheels_have_a_nose_that_is_explained(browser: Browser, tmp_path: Path) -> None:
    wheeled = Scenario.preset("mixed-wheels")
    plain = tuple(robot.replace(drive="force") for robot in wheeled.robots)
    record, shown, legends = watched(wheeled, episodes=2), [], []
    for name, scenario in (("wheels", wheeled), ("plain", wheeled.replace(robots=plain))):
        (tmp_path / name).mkdir()
        with visit(browser, written(tmp_path / name, replace(record, scenario=scenario))) as seen:
            ready(seen.page)
            legends.append(seen.page.locator("#legend").text_content() or "")
            shown.append(pixels(seen.page))
            assert not seen.problems
    assert "nose of a robot on wheels: where it points" in legends[0]
    assert "nose" not in legends[1]
    assert shown[0] != shown[1]
