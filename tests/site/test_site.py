"""The site: builds without a warning, every link leads somewhere, nothing comes from a network."""

import re
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from typing import Any, get_args
from urllib.parse import unquote, urlsplit

import pytest
from browser import PHONE, WIDE, opened_browser, until, visit
from playwright.sync_api import Browser

from innerattn.cli.main import COMMANDS
from innerattn.config import RunConfig, Scenario
from innerattn.config.team import TeamConfig
from innerattn.zoo import zoo_names

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.long  # it takes a minute to build


class Links(HTMLParser):
    """What a page links to, what it loads, and the places that can be linked to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        found = dict(attributes)
        if found.get("id"):
            self.places.add(str(found["id"]))
        if tag == "a" and found.get("href"):
            self.links.append(str(found["href"]))
        if tag in ("script", "img") and found.get("src"):
            self.loads.append(str(found["src"]))
        if tag == "link" and found.get("rel") in ("stylesheet", "icon"):
            self.loads.append(str(found["href"]))


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Links]:
    return {page: Links(page.read_text("utf-8")) for page in site.rglob("*.html")}


def test_links_and_anchors(site: Path, pages: dict[Path, Links]) -> None:
    checked = 0
    for page, found in pages.items():
        for link in found.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            to = page if not parts.path else (page.parent / unquote(parts.path)).resolve()
            assert to.is_file(), f"{page.relative_to(site)}: {link}"
            if parts.fragment and to in pages and to.name not in ("search.html", "genindex.html"):
                assert unquote(parts.fragment) in pages[to].places, f"{page}: {link}"
            checked += 1
    assert checked > 1_000


def test_nothing_is_loaded_from_a_network(pages: dict[Path, Links]) -> None:
    for page, found in pages.items():
        for load in found.loads:
            assert not urlsplit(load).netloc, f"{page}: {load}"
            assert (page.parent / unquote(urlsplit(load).path)).resolve().is_file(), load


def test_links_to_pages_show_titles(pages: dict[Path, Links]) -> None:
    """Names of files are for those who read the Markdown; what is set as code stays as it is."""
    for page in pages:
        text = re.sub(r"(?s)<code.*?</code>", "", page.read_text("utf-8"))
        assert not re.findall(r">[\w./-]+\.md</a>", text), page


def test_every_page_is_there(site: Path) -> None:
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        assert (site / page.relative_to(ROOT)).with_suffix(".html").is_file(), page


def test_the_reference_has_every_command_key_and_name(site: Path) -> None:
    def text_of(name: str) -> str:
        text = (site / "docs" / "reference" / f"{name}.html").read_text("utf-8")
        return re.sub(r"<[^>]+>", "", text)

    commands, keys, names = (text_of(one) for one in ("commands", "keys", "python"))
    assert all(f"usage: innerattn {name}" in commands for name in COMMANDS)
    sections: list[Any] = [field.annotation for field in RunConfig.model_fields.values()]
    sections = [(*get_args(one), one)[0] for one in sections]  # some may be left out
    for model in (Scenario, TeamConfig, *sections):
        for key in model.model_fields:
            assert re.search(rf"^\s*{key}$", keys, flags=re.MULTILINE), key
    rooms = [import_module(f"innerattn.{name}") for name in rooms_with_names()]
    assert len(rooms) > 12
    for room in rooms:
        public = [one for one in room.__all__ if callable(getattr(room, one))]
        missing = [one for one in public if one not in names]
        assert not missing, room.__name__


def rooms_with_names() -> list[str]:
    """Packages that say which of their names are public."""
    package = ROOT / "python" / "innerattn"
    files = [file for file in package.rglob("__init__.py") if "__all__" in file.read_text("utf-8")]
    return [file.parent.relative_to(package).as_posix().replace("/", ".") for file in files]


@pytest.fixture(scope="module")
def browser() -> Browser:
    with opened_browser() as found:
        yield found  # type: ignore[misc]


LOOKED_AT = sorted(
    path.relative_to(ROOT).with_suffix("").as_posix()
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("*/*.md")]
    if "tables" not in path.parts
)


@pytest.mark.parametrize("size", [WIDE, PHONE], ids=["wide", "phone"])
def test_no_page_scrolls_sideways(site: Path, browser: Browser, size: tuple[int, int]) -> None:
    for name in LOOKED_AT:
        with visit(browser, site / f"{name}.html", size) as seen:
            over = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
            assert seen.page.evaluate(over) <= 0, name
            broken = "[...document.images].filter(i => i.complete && !i.naturalWidth).length"
            assert seen.page.evaluate(broken) == 0, name


def test_the_teams_of_the_package_can_be_played_with(site: Path, browser: Browser) -> None:
    text = (site / "docs" / "zoo.html").read_text("utf-8")
    links = re.findall(r'href="\.\./play/([\w-]+)\.html"', text)
    assert links == list(zoo_names())
    assert 'href="play/mixed.html"' in (site / "README.html").read_text("utf-8")
    worked = re.findall(
        r'href="\.\./play/([\w-]+)\.html"', (site / "docs" / "scenario.html").read_text("utf-8")
    )
    scenarios = {file.stem for file in (ROOT / "examples" / "scenarios").glob("*.toml")}
    assert worked == sorted(scenarios & set(zoo_names()))
    for name in links:
        with visit(browser, site / "play" / f"{name}.html") as seen:
            until(seen.page, "Boolean(window.play)")
            seen.page.get_by_role("button", name="Pause").click()
            until(seen.page, "!play.link.busy && play.run.last > 0")
            heads = seen.page.evaluate("play.run.heads")
            assert heads == (0 if name == "any" else 4), name


def test_search_works_without_a_network(site: Path, browser: Browser) -> None:
    with visit(browser, site / "search.html") as seen:
        seen.page.goto((site / "search.html").as_uri() + "?q=hungarian")
        seen.page.wait_for_selector("#search-results li a", timeout=20_000)
        assert seen.page.locator("#search-results li").count() > 3


def test_the_first_page_leads_to_the_start(site: Path, browser: Browser) -> None:
    with visit(browser, site / "index.html") as seen:
        seen.page.wait_for_url("**/README.html")
        assert "innerattn" in seen.page.title()
