"""Puts what `innerattn reproduce` made into the documentation, text and pictures; it makes nothing.

`python benches/reproduction.py STUDY` fills a place in `docs/reproduction.md` from STUDY/report.md,
or from STUDY/crossed.md where the study is the crossed design.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
from pathlib import Path

from page import REPRODUCTION, publish


def main() -> None:
    """Copy the pictures and the report, a level of headings deeper."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder of the study")
    study = parser.parse_args().study
    account = json.loads((study / "runs.json").read_text())
    section = "crossed" if account["target"] == "crossed" else "report"
    text = (study / f"{section}.md").read_text()
    for name in re.findall(r"\]\(([^)]+)\.png\)", text):
        target = REPRODUCTION.parent / "images" / f"reproduction-{name}"
        for kind in (".png", ".pdf"):
            shutil.copyfile(study / f"{name}{kind}", target.with_suffix(kind))
        text = text.replace(f"({name}.png)", f"(images/{target.name}.png)")
    publish(section, re.sub("^#", "##", text, flags=re.MULTILINE).strip(), REPRODUCTION)


if __name__ == "__main__":
    main()
