"""Puts what `innerattn reproduce` made last in a study into the documentation.

`python docs/publish.py STUDY` fills the marked parts of a page. Of the paper's figures and of the
crossed design this is the whole report: figures go to `docs/images`, the tables that it links to a
folder of the page in `docs/tables`, and its runs to an archive in `docs/records`. Of learning and
robustness it is the tables, and where `KEPT` says so the runs. It makes no number and no figure.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from innerattn.errors import InnerattnError, RunError
from innerattn.experiments.archive import FILE, read_archive, write_archive
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, read_run
from innerattn.report.attention import page as attention
from innerattn.report.crossed import swapped
from innerattn.report.learning import ablations
from innerattn.report.learning.page import ATTENTION, SCORES
from innerattn.report.marks import fill, marked
from innerattn.report.robustness import page as robustness

DOCS = Path(__file__).parent
PLACES = {
    ("all", "short"): (DOCS / "reproduction.md", "reproduction-"),
    ("all", "paper"): (DOCS / "paper_protocol.md", "paper-protocol-"),
    ("crossed", "short"): (DOCS / "crossed.md", ""),
}
"""Where a report goes by its target and budget, and how the names of its figures begin."""
KEPT = {
    ("swapped", "short"): "swapped",
    ("attention", "fast"): "fast",
    ("attention", "strong"): "strong",
    ("learning-ablations", "fast"): "fast",
    ("learning", "strong"): "strong",
    ("learning-warm-start", "strong"): "strong",
    ("learning-long", "strong"): "strong",
    ("learning-afterstates", "strong"): "strong",
}
"""Names of archives of runs, which several targets may share; runs are added to what is there."""
Parts = Mapping[str, tuple[str, ...]]
"""Headings of a report by the part of a page that the text below them makes."""
TABLES: dict[tuple[str, str], tuple[Path, tuple[Parts, ...]]] = {
    (target, budget): (DOCS / "learning.md", ({part: (SCORES, ATTENTION)},))
    for target, budget, part in (
        ("learning", "fast", "learning_fast"),
        ("learning", "strong", "learning_strong"),
        ("learning", "quick", "learning_quick"),
        ("learning", "short", "learning_short"),
        ("learning-entities", "short", "learning_short_entities"),
        ("learning-continuous", "fast", "learning_fast_continuous"),
        ("learning-warm-start", "quick", "warm_start_quick"),
        ("learning-warm-start", "strong", "warm_start_strong"),
        ("learning-long", "strong", "learning_strong_long"),
        ("learning-afterstates", "strong", "learning_strong_afterstates"),
    )
} | {
    ("swapped", "short"): (DOCS / "swapped.md", ({"swapped": (swapped.ANSWER, swapped.SHARES)},)),
    ("learning-ablations", "fast"): (
        DOCS / "learning.md",
        ({"ablations_fast": (ablations.DIFFERENCES,)},),
    ),
    **{
        ("attention", budget): (
            DOCS / "attention.md",
            ({f"attention_{budget}": (attention.COMPARISONS, attention.SCORES)},),
        )
        for budget in ("fast", "strong")
    },
    ("robustness", "short"): (
        DOCS / "robustness.md",
        (
            {
                "deployment": (f"{robustness.RETENTION}: mixed",),
                "recovery": (f"{robustness.RECOVERY}: mixed",),
                "bounds": (f"{robustness.BOUNDS}: mixed",),
                "attention": (f"{robustness.ATTENTION}: mixed",),
                "training": (robustness.TRAINING,),
                "redundancy": (robustness.TEAMS,),
            },
            {"recovery_double": (f"{robustness.RECOVERY}: double",)},
        ),
    ),
}
"""By target and budget the page, and groups of its parts.

A report has all parts of a group, or none where a study leaves out what the group is about.
"""


def main() -> None:
    """Publish the study that is named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder of the study")
    study = parser.parse_args().study
    try:
        account = json.loads((study / "runs.json").read_text())
    except FileNotFoundError:
        sys.exit(f"{study}: no study; `innerattn reproduce` makes one")
    made = account["target"], account["budget"]
    name = report_name(account["target"])
    if made not in PLACES.keys() | TABLES.keys() or name not in account["outputs"]:
        sys.exit(
            f"{study}: last made {made[0]} of budget {made[1]!r}, for which no page has a place, "
            f"or was interrupted; there are places for {_listed()}"
        )
    try:
        if made in TABLES:
            publish_tables(study / name, *TABLES[made])
            if made in KEPT:
                _add(account["runs"], study, DOCS / "records" / f"{KEPT[made]}.parquet")
        else:
            page, figures = PLACES[made]
            _archive(account["runs"], study, DOCS / "records" / f"{page.stem}.parquet")
            publish_report(study / name, page, figures)
    except InnerattnError as error:
        sys.exit(str(error))


def report_name(target: str) -> str:
    """The file of a target's report."""
    return "report.md" if target == "all" else f"{target.replace('-', '_')}.md"


def publish_tables(report: Path, page: Path, groups: Sequence[Parts]) -> None:
    """Put sections of a report into parts of a page, and its figure where the page shows it.

    Raises:
        RunError: the page lacks a part, or the report the first section of one, other than all of
            a group; nothing is changed.
    """
    found = by_heading(report.read_text())
    there = [parts for parts in groups if any(first in found for first, *_ in parts.values())]
    for parts in there or groups:
        for part, headings in parts.items():
            marked(page, part)
            if headings[0] not in found:
                raise RunError(f"{report}: has no section {headings[0]!r}; runs are missing")
    for parts in there:
        for part, headings in parts.items():
            text = "\n\n".join(found[one] for one in headings if one in found)
            fill(page, part, text)
            figure = DOCS / "images" / f"{part}.png"
            source = report.with_suffix(".png")
            if source.exists() and f"(images/{figure.name})" in page.read_text():
                shutil.copyfile(source, figure)


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
    fill(page, "summary", summary)
    fill(page, "details", details)


def sections(report: str, page: Path, figures: str) -> tuple[str, str]:
    """What a page opens with and what stands below, without the report's own title."""
    opening, details = links(report, page, figures).split("\n## ", 1)
    return opening.split("\n", 1)[1].strip(), f"## {details.strip()}"


def links(text: str, page: Path, figures: str) -> str:
    """A text whose links go to where a page keeps figures and tables."""
    text = re.sub(r"\(([\w-]+\.png)\)", rf"(images/{figures}\1)", text)
    return re.sub(r"\(([\w-]+\.(?:md|csv))\)", rf"(tables/{page.stem}/\1)", text)


def by_heading(report: str) -> dict[str, str]:
    """What stands below each heading of the second level."""
    parts = (part.partition("\n") for part in re.split("^## ", report, flags=re.MULTILINE)[1:])
    return {heading: text.strip() for heading, _, text in parts}


def _listed() -> str:
    return ", ".join(f"{target} of {budget}" for target, budget in (*PLACES, *TABLES))


def _archive(runs: list[dict[str, Any]], study: Path, path: Path) -> None:
    """Write the runs that a report is made of into one file."""
    write_archive(_finished(runs, study), path)


def _add(runs: list[dict[str, Any]], study: Path, path: Path) -> None:
    """Write the runs that a report is made of into a file that keeps the others it has."""
    known = {run.folder.name: run for run in read_archive(path)} if path.exists() else {}
    found = known | {run.folder.name: run for run in _finished(runs, study)}
    write_archive((found[name] for name in sorted(found)), path)


def _finished(runs: list[dict[str, Any]], study: Path) -> list[FinishedRun]:
    """The finished runs of an account, from their folders or from the study's archive."""
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
    return finished


if __name__ == "__main__":
    main()
