"""Puts what `innerattn reproduce` made into the documentation: text, pictures, records of runs.

`python benches/reproduction.py STUDY` fills the places of STUDY's newest report: of budget `short`
in `docs/reproduction.md`, of budget `paper` in `docs/paper_protocol.md`, and of the crossed design
in `docs/crossed.md`. A page opens with the table of claims; the rest stands below. Its runs go to
an archive in `docs/records`. It makes no figure.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from page import CROSSED, PAPER_PROTOCOL, REPRODUCTION, publish

from innerattn.errors import InnerattnError
from innerattn.experiments.archive import write_archive
from innerattn.experiments.plan import Case
from innerattn.experiments.run import read_run

PLACES = {
    ("report.md", "short"): (REPRODUCTION, "reproduction"),
    ("report.md", "paper"): (PAPER_PROTOCOL, "paper-protocol"),
    ("crossed.md", "short"): (CROSSED, "reproduction"),
}
"""Where a report goes by its budget, and how the names of its pictures begin."""
DOCS = REPRODUCTION.parent


def main() -> None:
    """Copy the pictures, the report, a level of headings deeper, and the records."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder of the study")
    study = parser.parse_args().study
    try:
        account = json.loads((study / "runs.json").read_text())
    except FileNotFoundError:
        sys.exit(f"{study}: no study; `innerattn reproduce` makes one")
    name = {"all": "report.md", "crossed": "crossed.md"}.get(account["target"], "")
    place = PLACES.get((name, account["budget"]))
    if place is None or name not in account["outputs"]:
        sys.exit(
            f"{study}: last made {account['target']} of budget {account['budget']!r}, for which no "
            "page has a place, or was interrupted; make all or crossed"
        )
    page, pictures = place
    try:
        _archive(account["runs"], study, DOCS / "records" / f"{page.stem}.parquet")
    except InnerattnError as error:
        sys.exit(str(error))
    claims, full = _with_pictures(study / name, pictures).split("\n### ", 1)
    publish("claims", claims.strip(), page)
    publish("report", f"### {full}", page)


def _with_pictures(report: Path, prefix: str) -> str:
    """A report as part of a page; its pictures are copied to where the page shows them."""
    text = report.read_text()
    for name in re.findall(r"\]\(([^)]+)\.png\)", text):
        target = DOCS / "images" / f"{prefix}-{name}"
        for kind in (".png", ".pdf"):
            shutil.copyfile(report.with_name(f"{name}{kind}"), target.with_suffix(kind))
        text = text.replace(f"({name}.png)", f"(images/{target.name}.png)")
    return re.sub("^#", "##", text, flags=re.MULTILINE).strip()


def _archive(runs: list[dict[str, Any]], study: Path, path: Path) -> None:
    """Write the runs that a report is made of into one file."""
    finished = []
    for run in runs:
        if run["state"] == "finished":
            case = Case(run["situation"], run["method"], run["seed"], run["variant"])
            finished.append(read_run(case, study / run["folder"], steps=False))
    write_archive(finished, path)


if __name__ == "__main__":
    main()
