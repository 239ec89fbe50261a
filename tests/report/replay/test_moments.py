"""Moments that somebody chose: what files may say, and what the page makes of it."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import opened_browser, until, visit
from playwright.sync_api import Browser, Page
from watched import watched

from innerattn.cli.replay import recorded
from innerattn.errors import ConfigError
from innerattn.records.record import Record
from innerattn.report.replay import read_moments, replay_page

ROOT = Path(__file__).parents[3]
FILE = """
[[moments]]
text = "medical_0 turns to the <other> robot"
episode = 4
step = 17
robot = "medical_0"
attention = "actor"
head = 2

[[moments]]
text = "all look at food_1"
policy = "b"
episode = 1
step = 1
robot = "food_1"
arrows = "to"
"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return [watched(actor_heads=2), watched(script="greedy")]


def shown(page: Page) -> dict[str, object]:
    """What the page shows, as its own variables say."""
    until(page, "Boolean(window.replay)")
    found: dict[str, object] = page.evaluate(
        "({policy: replay.run.name, episode: replay.episode, step: replay.step,"
        " robot: replay.worlds.robots[replay.look.robot].name, whose: replay.whose,"
        " head: replay.look.head, received: replay.look.received, all: replay.look.all})"
    )
    return found


FIRST = {
    "policy": "a",
    "episode": 4,
    "step": 16,
    "robot": "medical_0",
    "whose": "actor",
    "head": 1,
    "received": False,
    "all": False,
}
SECOND = FIRST | {
    "policy": "b",
    "episode": 1,
    "step": 0,
    "robot": "food_1",
    "whose": "critic",
    "head": -1,
    "received": True,
}


def test_a_page_opens_with_the_first_moment_and_lists_all(
    browser: Browser, tmp_path: Path, records: list[Record]
) -> None:
    file, path = tmp_path / "moments.toml", tmp_path / "replay.html"
    file.write_text(FILE, "utf-8")
    moments = read_moments(file, records, ["a", "b"])
    path.write_text(replay_page(records, ["a", "b"], moments), "utf-8")
    with visit(browser, path) as seen:
        page = seen.page
        assert shown(page) == FIRST
        links = page.locator("#moments a")
        texts = ["medical_0 turns to the <other> robot", "all look at food_1"]
        assert links.all_inner_texts() == texts
        links.nth(1).click()
        until(page, "replay.run.name === 'b'")
        assert shown(page) == SECOND
        assert [one.get_attribute("aria-current") for one in links.all()] == ["false", "true"]
        links.nth(0).click()
        until(page, "replay.run.name === 'a'")
        assert shown(page) == FIRST
        assert not seen.serious_faults()


def test_a_link_to_what_is_shown_shows_it_again(
    browser: Browser, tmp_path: Path, records: list[Record]
) -> None:
    path = tmp_path / "replay.html"
    path.write_text(replay_page(records, ["a", "b"]), "utf-8")
    with visit(browser, path) as seen:
        page = seen.page
        before = shown(page)
        assert not page.locator("#moments-box").is_visible()
        page.get_by_role("slider", name="Step").fill("7")
        page.get_by_role("button", name="b", exact=True).click()
        page.get_by_role("button", name="navigation_0").first.click()
        page.keyboard.press("a")
        wanted, address = shown(page), page.locator("#here").get_attribute("href")
    assert wanted != before
    with visit(browser, f"{path.as_uri()}{address}") as seen:
        assert shown(seen.page) == wanted


@pytest.mark.parametrize("address", ["#", "#episode=99&robot=nobody&attention=mine&head=x", "#="])
def test_an_address_of_nothing_changes_nothing(
    browser: Browser, tmp_path: Path, records: list[Record], address: str
) -> None:
    path = tmp_path / "replay.html"
    path.write_text(replay_page(records[:1], ["a"]), "utf-8")
    with visit(browser, path) as seen:
        plain = shown(seen.page)
    with visit(browser, f"{path.as_uri()}{address}") as seen:
        assert shown(seen.page) == plain


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("episode = 4", "episode = 6", r"moments\[0\].episode = 6: must be 0 to 5"),
        ("step = 17", "step = 26", r"moments\[0\].step = 26: must be 1 to 25"),
        ("step = 17", "step = 0", r"moments\[0\].step = 0: must be 1 to 25"),
        ('"food_1"', '"food_7"', r"moments\[1\].robot = 'food_7': must be one of food_0, food_1"),
        ('"b"', '"c"', r"moments\[1\].policy = 'c': must be one of a, b"),
        ("head = 2", "head = 3", r"moments\[0\].head = 3: must be 1 to 2"),
        ('arrows = "to"', 'attention = "actor"', r"moments\[1\].attention = 'actor': was not rec"),
        ('arrows = "to"', 'arrows = "by"', r"moments\[1\].arrows = 'by': must be 'from', 'to' or"),
        ("step = 17", "stop = 17", r"moments\[0\].stop: unknown key, did you mean step"),
    ],
)
def test_a_moment_that_is_not_there_is_refused(
    tmp_path: Path, records: list[Record], old: str, new: str, message: str
) -> None:
    file = tmp_path / "moments.toml"
    file.write_text(FILE.replace(old, new, 1), "utf-8")
    with pytest.raises(ConfigError, match=f"^{file}: .*{message}"):
        read_moments(file, records, ["a", "b"])


PUBLISHED = sorted((ROOT / "docs" / "moments").glob("*/moments.toml"))


@pytest.mark.parametrize("file", PUBLISHED, ids=lambda file: file.parent.name)
def test_published_moments_say_how_large_weights_are(file: Path) -> None:
    """A robot's largest weight is the largest share that the text names."""
    record = recorded(str(file.parent))
    moments = tomllib.loads(file.read_text("utf-8"))["moments"]
    assert len(read_moments(file, [record], ["a"])) == len(moments) == 10
    for one in moments:
        episode = one["episode"] - record.first_episode
        kind = "actor_attention" if one.get("attention") == "actor" else "attention"
        weights = record.steps[kind][episode, one["step"] - 1].mean(0)
        shares = [round(100 * float(w)) for w in weights[record.robot_names.index(one["robot"])]]
        named = [int(share) for share in re.findall(r"(\d+) %", one["text"])]
        assert set(named) <= set(shares), one["text"]
        assert max(named, default=100) == max(shares), one["text"]


def test_a_head_needs_attention(tmp_path: Path) -> None:
    file = tmp_path / "moments.toml"
    file.write_text('[[moments]]\ntext = "a"\nepisode = 0\nstep = 1\nhead = 1\n', "utf-8")
    with pytest.raises(ConfigError, match=r"head = 1: no attention was recorded"):
        read_moments(file, [watched(heads=0)], ["a"])
