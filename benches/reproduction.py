"""Puts what `innerattn reproduce` made into the documentation, text and pictures; it makes nothing.

`python benches/reproduction.py STUDY` fills a place in `docs/reproduction.md` from the report in
STUDY.
"""

from __future__ import annotations

import argparse
import re
import shutil
from pathlib import Path

from page import REPRODUCTION, publish


def main() -> None:
    """Copy the pictures and the report, a level of headings deeper."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder of the study")
    study = parser.parse_args().study
    text = (study / "report.md").read_text()
    for name in re.findall(r"\]\(([^)]+)\.png\)", text):
        target = REPRODUCTION.parent / "images" / f"reproduction-{name}"
        for kind in (".png", ".pdf"):
            shutil.copyfile(study / f"{name}{kind}", target.with_suffix(kind))
        text = text.replace(f"({name}.png)", f"(images/{target.name}.png)")
    publish("report", re.sub("^#", "##", text, flags=re.MULTILINE).strip(), REPRODUCTION)


if __name__ == "__main__":
    main()
