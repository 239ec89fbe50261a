"""Marked parts of a page are filled, and everything else is left alone."""

from pathlib import Path

import pytest

from innerattn.errors import RunError
from innerattn.report.marks import fill, marked

PAGE = "# A\n\n<!-- a: begin -->\nold\n<!-- a: end -->\n\nB\n\n<!-- b: begin -->\n<!-- b: end -->\n"


@pytest.fixture
def page(tmp_path: Path) -> Path:
    path = tmp_path / "page.md"
    path.write_text(PAGE)
    return path


def test_a_part_is_replaced(page: Path) -> None:
    assert marked(page, "a")[1] == "old\n"
    fill(page, "a", "\n1 α\n\n")
    assert page.read_text("utf-8") == PAGE.replace("old", "\n1 α\n")
    fill(page, "b", "2")
    assert [marked(page, name)[1].strip() for name in "ab"] == ["1 α", "2"]


@pytest.mark.parametrize("text", ["", "<!-- a: begin -->\n", "<!-- a: end -->\n"])
def test_a_page_without_the_part_is_refused(text: str, page: Path) -> None:
    page.write_text(text)
    with pytest.raises(RunError, match=r"page\.md: no marks <!-- a: begin --> and <!-- a: end -->"):
        fill(page, "a", "1")
    assert page.read_text() == text
