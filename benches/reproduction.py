"""Puts what `innerattn reproduce` made into the documentation: text, figures, tables, records.

`python benches/reproduction.py STUDY` fills the places of STUDY's newest report: of budget `short`
in `docs/reproduction.md`, of budget `paper` in `docs/paper_protocol.md`, and of the crossed design
in `docs/crossed.md`. A page opens with what the report opens with; the rest stands below. Figures
go to `docs/images`, the tables that a report links to a folder of the page in `docs/tables`, and
its runs to an archive in `docs/records`. It makes no number and no figure.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from page import CROSSED, PAPER_PROTOCOL, REPRODUCTION, publish

from innerattn.errors import InnerattnError
from innerattn.experiments.archive import FILE, read_archive, write_archive
from innerattn.experiments.plan import Case
from innerattn.experiments.run import read_run

PLACES = {
    ("report.md", "short"): (REPRODUCTION, "reproduction-"),
    ("report.md", "paper"): (PAPER_PROTOCOL, "paper-protocol-"),
    ("crossed.md", "short"): (CROSSED, ""),
}
"""Where a report goes by its budget, and how the names of its figures begin."""
DOCS = REPRODUCTION.parent


def main() -> None:
    """Copy the report, its figures and tables, and the records."""
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
    page, figures = place
    try:
        _archive(account["runs"], study, DOCS / "records" / f"{page.stem}.parquet")
    except InnerattnError as error:
        sys.exit(str(error))
    publish_report(study / name, page, figures)


def publish_report(report: Path, page: Path, figures: str) -> None:
    """Put a report into its page, and copy what it links."""
    summary, details = sections(report.read_text(), page, figures)
    for name in re.findall(r"\]\(([^)/]+)\)", report.read_text()):
        target = DOCS / links(f"({name})", page, figures).strip("()")
        target.parent.mkdir(parents=True, exist_ok=True)
        suffixes = (".png", ".pdf") if target.suffix == ".png" else (target.suffix,)
        for suffix in suffixes:
            source = (report.parent / name).with_suffix(suffix)
            shutil.copyfile(source, target.with_suffix(suffix))
    publish("summary", summary, page)
    publish("details", details, page)


def sections(report: str, page: Path, figures: str) -> tuple[str, str]:
    """What a page opens with and what stands below, without the report's own title."""
    opening, details = links(report, page, figures).split("\n## ", 1)
    return opening.split("\n", 1)[1].strip(), f"## {details.strip()}"


def links(text: str, page: Path, figures: str) -> str:
    """A text whose links go to where a page keeps figures and tables."""
    text = re.sub(r"\(([\w-]+\.png)\)", rf"(images/{figures}\1)", text)
    return re.sub(r"\(([\w-]+\.(?:md|csv))\)", rf"(tables/{page.stem}/\1)", text)


def _archive(runs: list[dict[str, Any]], study: Path, path: Path) -> None:
    """Write the runs that a report is made of into one file."""
    archive = study / FILE
    archived = read_archive(archive) if os.path.lexists(archive) else []
    by_name = {run.folder.name: run for run in archived}
    finished = []
    for run in runs:
        if run["state"] != "finished":
            continue
        folder = study / run["folder"]
        case = Case(run["situation"], run["method"], run["seed"], run["variant"])
        if os.path.lexists(folder):
            finished.append(read_run(case, folder, steps=False))
        else:
            finished.append(by_name[folder.name])
    write_archive(finished, path)


if __name__ == "__main__":
    main()
