"""CITATION.cff says what the package is, and the pages about versions name what is there."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

import innerattn

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def citation() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    return found


def test_its_version_is_that_of_the_package_and_its_date_that_of_the_changelog(
    citation: dict[str, Any],
) -> None:
    assert str(citation["version"]) == innerattn.__version__
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert f"\n## {citation['version']} - {citation['date-released']}\n" in changelog


def test_it_has_what_the_format_asks_for(citation: dict[str, Any]) -> None:
    assert citation["cff-version"] == "1.2.0"
    assert citation.keys() >= {"message", "title", "type", "authors"}
    assert all("name" in one for one in citation["authors"])


def test_it_names_the_paper_as_the_page_about_it_does(citation: dict[str, Any]) -> None:
    (paper,) = citation["references"]
    assert {"type", "title", "authors"} <= paper.keys()
    page = " ".join((ROOT / "docs" / "paper.md").read_text("utf-8").split())
    families = " and ".join(one["family-names"] for one in paper["authors"])
    assert f"{families}, *{paper['title']}*" in page
    assert not re.search(r"doi", (ROOT / "CITATION.cff").read_text("utf-8"), re.IGNORECASE)


def test_the_page_about_upgrades_says_of_each_change_what_to_do() -> None:
    page = (ROOT / "docs" / "upgrade.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    head, *changes = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert head == ["about", "was in 0.1.0", "is in 0.2.0", "what to do"]
    assert len(changes) > 15
    assert all(len(cells) == 4 and all(cells) for cells in changes)
    assert innerattn.__version__ in head[2]
