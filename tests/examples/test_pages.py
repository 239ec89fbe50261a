"""The pages about extending show the files in examples/ as they are."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BLOCK = r"^`(examples/[^`]+)`:\n\n```\w+\n(.*?)^```$"


@pytest.mark.parametrize(
    ("page", "example"), [("algorithm", "ippo"), ("network", "additive_attention")]
)
def test_pages_show_every_file_of_their_example(page: str, example: str) -> None:
    text = (ROOT / "docs" / "extending" / f"{page}.md").read_text("utf-8")
    shown = dict(re.findall(BLOCK, text, flags=re.DOTALL | re.MULTILINE))
    folder = ROOT / "examples" / example
    files = [*folder.glob("*.toml"), *folder.rglob("*.py")]
    expected = {str(file.relative_to(ROOT)): file.read_text("utf-8") for file in files}
    assert shown == expected
    for line in re.findall(r"^\| `(tests/[^`]+)`", text, flags=re.MULTILINE):
        assert (ROOT / line).is_file()
