"""Puts what `innerattn reproduce` made into the documentation, text and pictures; it makes nothing.

`python benches/reproduction.py STUDY` fills a place in `docs/reproduction.md` from the report in
STUDY, and one in `docs/crossed.md` from its crossed design, whichever are there.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from pathlib import Path

from page import CROSSED, REPRODUCTION, publish

PAGES = {"report.md": REPRODUCTION, "crossed.md": CROSSED}
"""Where each report of a study goes."""


def main() -> None:
    """Copy the pictures and the reports, a level of headings deeper."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder of the study")
    study = parser.parse_args().study
    reports = [study / name for name in PAGES if (study / name).exists()]
    if not reports:
        sys.exit(f"{study}: none of {', '.join(PAGES)}")
    for report in reports:
        publish("report", _with_pictures(report), PAGES[report.name])


def _with_pictures(report: Path) -> str:
    """A report as part of a page; its pictures are copied to where the page shows them."""
    text = report.read_text()
    for name in re.findall(r"\]\(([^)]+)\.png\)", text):
        target = REPRODUCTION.parent / "images" / f"reproduction-{name}"
        for kind in (".png", ".pdf"):
            shutil.copyfile(report.with_name(f"{name}{kind}"), target.with_suffix(kind))
        text = text.replace(f"({name}.png)", f"(images/{target.name}.png)")
    return re.sub("^#", "##", text, flags=re.MULTILINE).strip()


if __name__ == "__main__":
    main()
