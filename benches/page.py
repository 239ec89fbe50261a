"""Tables of measurements: printed, and written into their place in the documentation."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Sequence
from datetime import date
from importlib.metadata import version
from pathlib import Path

from innerattn.errors import RunError
from innerattn.report.marks import fill

PERFORMANCE = Path(__file__).parents[1] / "docs" / "performance.md"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table, aligned for the terminal, too; all columns but the first to the right."""
    lines = [list(head), *[list(row) for row in rows]]
    widths = [max(len(line[column]) for line in lines) for column in range(len(head))]
    edge = [width if column == 0 else width - 1 for column, width in enumerate(widths)]
    rule = [("-" * edge[c]) + ("" if c == 0 else ":") for c in range(len(head))]

    def line(cells: Sequence[str]) -> str:
        aligned = [
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(cells, widths, strict=True))
        ]
        return f"| {' | '.join(aligned)} |"

    return "\n".join([line(lines[0]), line(rule), *map(line, lines[1:])])


def machine(*packages: str) -> str:
    """One line: processor, cores, Python and the versions of packages, and the date."""
    return f"{system(*packages)}, {date.today()}"


def system(*packages: str) -> str:
    """One line: processor, cores, Python and the versions of packages."""
    processor = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [
            x.split(":")[1].strip() for x in info.read_text().splitlines() if "model name" in x
        ]
        processor = names[0] if names else processor
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()
    versions = [f"Python {platform.python_version()}"]
    versions += [f"{name} {version(name)}" for name in packages]
    return ", ".join([processor, f"{cores} cores", *versions])


def publish(part: str, text: str, page: Path = PERFORMANCE) -> None:
    """Print a text and put it into a part of a page.

    Raises:
        SystemExit: the page has no such part.
    """
    print(text, flush=True)
    try:
        fill(page, part, text)
    except RunError as error:
        sys.exit(str(error))
