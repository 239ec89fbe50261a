"""Counts the words that people wrote in the documentation: `python docs/words.py`.

It prints the words of each page and their sum. Not counted are `docs/tables/`, `CHANGELOG.md`,
parts between marks (`innerattn.report.marks`), code blocks, rows of tables, pictures, and the
addresses of links.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WHERE = ("*.md", "docs/**/*.md", "examples/**/*.md")
LEFT_OUT = ("CHANGELOG.md", "docs/tables/")
NOT_COUNTED = (
    r"(?ms)<!-- (?P<name>\w+): begin -->.*?<!-- (?P=name): end -->",
    r"(?ms)^(?P<indent> *)(?P<fence>```+|~~~+).*?^(?P=indent)(?P=fence)[ \t]*$",
    r"(?m)^ *\|.*$",
    r"!\[[^\]]*\]\([^)]*\)",
    r"(?<=\])\([^)\s]*\)",
)


def pages(root: Path = ROOT) -> list[Path]:
    """The pages that people wrote, in order of their paths."""
    found = []
    for path in (path for pattern in WHERE for path in root.glob(pattern)):
        place = path.relative_to(root)
        hidden = any(part.startswith(".") for part in place.parts)
        if not hidden and not place.as_posix().startswith(LEFT_OUT):
            found.append(path)
    return sorted(found)


def words(text: str) -> int:
    """How many words of a page people wrote as headings, paragraphs and lists."""
    for what in NOT_COUNTED:
        text = re.sub(what, " ", text)
    return sum(any(sign.isalnum() for sign in word) for word in text.split())


def main() -> None:
    """Prints the words of each page, the longest first, and their sum."""
    counts = {path.relative_to(ROOT).as_posix(): words(path.read_text("utf-8")) for path in pages()}
    for page, count in sorted(counts.items(), key=lambda item: -item[1]):
        print(f"{count:6,}  {page}")
    print(f"{sum(counts.values()):6,}  in all")


if __name__ == "__main__":
    main()
