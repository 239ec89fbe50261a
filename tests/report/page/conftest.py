"""What the tests of pages share: a browser."""

from collections.abc import Iterator

import pytest
from browser import opened_browser
from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found
