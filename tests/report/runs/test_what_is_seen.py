"""What a person sees in a report: the sentence about handoffs, and the replay in its frame."""

from collections.abc import Iterator
from html import escape
from pathlib import Path

import pytest
from browser import PHONE, WIDE, opened_browser, until, visit
from playwright.sync_api import Browser, Page

from innerattn.experiments.paper.fig5 import evidence
from innerattn.experiments.run import FinishedRun
from innerattn.report.paper.fig5 import shift_sentence
from innerattn.report.runs.page import runs_page

FRAME = "document.querySelector('iframe')"
INSIDE = f"{FRAME}.contentDocument?.documentElement?"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


@pytest.fixture(scope="module")
def inner(runs: list[FinishedRun]) -> list[FinishedRun]:
    return [run for run in runs if (run.situation, run.method) == ("mixed", "td-inner")]


def test_a_sentence_tells_what_singles_out_the_partner_at_handoffs(
    inner: list[FinishedRun],
) -> None:
    found = evidence(inner)
    assert found is not None
    assert f"<p>{escape(shift_sentence(found))}</p>" in runs_page(inner)


@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_the_replay_fits_its_frame_and_dark_is_for_the_whole_page(
    browser: Browser, tmp_path: Path, inner: list[FinishedRun], size: tuple[int, int]
) -> None:
    path = tmp_path / "report.html"
    path.write_text(runs_page(inner[:1]), "utf-8")
    with visit(browser, path, size) as seen:
        replay = seen.page.frame_locator("iframe")
        replay.get_by_role("button", name="Next event").click()
        replay.locator("#theme").wait_for(state="hidden")
        if size == WIDE:
            until(seen.page, f"{FRAME}.clientHeight >= {INSIDE}.offsetHeight")
            assert seen.page.evaluate(f"{INSIDE}.scrollHeight <= {INSIDE}.clientHeight")
            assert seen.page.evaluate(f"{FRAME}.clientHeight - {INSIDE}.offsetHeight") < 5
        else:
            play_stays_in_sight(seen.page)
        assert seen.page.evaluate(f"{INSIDE}.scrollWidth <= {INSIDE}.clientWidth")
        button = seen.page.get_by_role("button", name="Dark")
        for now, pressed in (("dark", "true"), ("light", "false")):
            button.click()
            assert button.get_attribute("aria-pressed") == pressed
            assert seen.page.evaluate("document.documentElement.dataset.theme") == now
            until(seen.page, f"{INSIDE}.dataset.theme === '{now}'")


def play_stays_in_sight(page: Page) -> None:
    """Scrolls the replay in its frame, which is lower than the screen, from end to end."""
    assert page.evaluate(f"{FRAME}.offsetHeight") <= 0.88 * PHONE[1] + 1
    page.evaluate(f"{FRAME}.scrollIntoView({{ block: 'center' }})")
    play = page.frame_locator("iframe").get_by_role("button", name="Play")
    end = page.evaluate(f"{INSIDE}.scrollHeight")
    assert end > 2 * PHONE[1]
    for place in range(0, end, 400):
        page.evaluate(f"{FRAME}.contentWindow.scrollTo(0, {place})")
        box = play.bounding_box()
        assert box is not None
        assert 0 <= box["y"] < PHONE[1] - 40
    page.evaluate(f"{FRAME}.contentWindow.scrollTo(0, 0)")
    before = page.evaluate("scrollY")
    page.mouse.move(PHONE[0] / 2, PHONE[1] / 2)
    page.mouse.wheel(0, -300)  # from its top on, the page around it scrolls
    until(page, f"scrollY < {before}")
