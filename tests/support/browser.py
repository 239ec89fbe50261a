"""A browser for tests of pages: Debian's headless Chromium, driven by Playwright."""

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, sync_playwright

REQUIRED = "INNERATTN_BROWSER_REQUIRED"
"""Environment variable that makes a missing browser a failure."""
NAMES = ("chromium-headless-shell", "chromium", "google-chrome")
WIDE, PHONE = (1280, 900), (390, 844)


@contextmanager
def opened_browser() -> Iterator[Browser]:
    """A browser. Where there is none the test is skipped; where one must be, it fails."""
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        missing = f"none of {', '.join(NAMES)} is installed: apt-get install {NAMES[0]}"
        if os.environ.get(REQUIRED):
            pytest.fail(missing)
        pytest.skip(missing)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


def until(page: Page, expression: str, seconds: float = 20.0) -> None:
    """Waits until an expression is true; the page itself may not evaluate any text."""
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        assert time.monotonic() < end, f"not true after {seconds} s: {expression}"
        page.wait_for_timeout(20)


@dataclass
class Visit:
    """A page that is open, and what went wrong on it."""

    page: Page
    problems: list[str] = field(default_factory=list)

    def serious_faults(self) -> list[str]:
        """What axe-core finds that keeps people from using the page."""
        before = list(self.problems)
        found: Any = Axe().run(self.page).response["violations"]
        self.problems[:] = before  # axe-core itself complains of frames
        return [
            f"{one['id']}: {one['help']} {[node['target'] for node in one['nodes']]}"
            for one in found
            if one["impact"] in ("serious", "critical")
        ]


@contextmanager
def visit(
    browser: Browser,
    path: Path | str,
    size: tuple[int, int] = WIDE,
    theme: str = "light",
    **options: Any,
) -> Iterator[Visit]:
    """Opens a file without any network, or an address; nothing may go wrong on it."""
    context: Any = browser.new_context(
        viewport={"width": size[0], "height": size[1]},
        color_scheme=theme,
        offline=isinstance(path, Path),
        **options,
    )
    found = Visit(context.new_page())
    found.page.on(
        "console",
        lambda message: (
            found.problems.append(message.text) if message.type in ("error", "warning") else None
        ),
    )
    found.page.on("pageerror", lambda error: found.problems.append(str(error)))
    found.page.goto(path.as_uri() if isinstance(path, Path) else path)
    yield found
    context.close()
    assert not found.problems
