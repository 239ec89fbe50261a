"""Parts of a page that a command writes: the text between two marks, which are HTML comments.

A part NAME stands between ``<!-- NAME: begin -->`` and ``<!-- NAME: end -->``.
"""

from __future__ import annotations

from pathlib import Path

from innerattn.config.files import write_whole
from innerattn.errors import RunError


def marked(page: Path, name: str) -> tuple[str, str, str]:
    """A page in three: up to the part with its first mark, the part, and the rest.

    Raises:
        RunError: the page has no such part.
        OSError: it cannot be read.
    """
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, found, rest = page.read_text("utf-8").partition(begin)
    part, found_end, after = rest.partition(end)
    if not found or not found_end:
        raise RunError(f"{page}: no marks {begin.strip()} and {end}")
    return before + begin, part, end + after


def fill(page: Path, name: str, text: str) -> None:
    """Put a text into a part of a page; the page changes as a whole or not at all.

    Raises:
        RunError: the page has no such part.
        OSError: it cannot be read or written.
    """
    before, _, after = marked(page, name)
    write_whole(page, f"{before}\n{text.strip()}\n\n{after}".encode())
