"""Puts the report of a study of `innerattn reproduce` into the documentation.

`python docs/publish.py studies/BUDGET/TARGET` fills the marked parts of a page. Of the paper's
figures and of the crossed design this is the whole report: figures go to `docs/images`, the tables
that it links to a folder of the page in `docs/tables`, and its runs to an archive in
`docs/records`. Of other studies it is the tables, and where `KEPT` says so the runs. It makes no
number and no figure.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from innerattn.errors import InnerattnError, RunError
from innerattn.experiments.archive import read_archive, write_archive
from innerattn.report.crossed import swapped
from innerattn.report.marks import fill, marked
from innerattn.report.robustness import page as robustness
from innerattn.report.targets import TARGETS
from innerattn.studies.folder import open_study
from innerattn.studies.results import read_results

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
SCORES = ("Scores", "Contrasts")
ASKED = SCORES[::-1]
"""Headings of the report that every study has; of one without contrasts, the first alone."""
TABLES: dict[tuple[str, str], tuple[Path, tuple[Parts, ...]]] = {
    (target, budget): (DOCS / page, ({part: ASKED if target == "attention" else SCORES},))
    for target, budget, page, part in (
        ("learning", "fast", "learning.md", "learning_fast"),
        ("learning", "strong", "learning.md", "learning_strong"),
        ("learning", "quick", "learning.md", "learning_quick"),
        ("learning", "short", "learning.md", "learning_short"),
        ("learning-entities", "short", "learning.md", "learning_short_entities"),
        ("learning-continuous", "fast", "learning.md", "learning_fast_continuous"),
        ("learning-warm-start", "quick", "learning.md", "warm_start_quick"),
        ("learning-warm-start", "strong", "learning.md", "warm_start_strong"),
        ("learning-long", "strong", "learning.md", "learning_strong_long"),
        ("learning-afterstates", "strong", "learning.md", "learning_strong_afterstates"),
        ("learning-ablations", "fast", "learning.md", "ablations_fast"),
        ("attention", "fast", "attention.md", "attention_fast"),
        ("attention", "strong", "attention.md", "attention_strong"),
    )
} | {
    ("swapped", "short"): (DOCS / "swapped.md", ({"swapped": (swapped.ANSWER, swapped.SHARES)},)),
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
    parser.add_argument(
        "study", type=Path, help="folder of the study, such as studies/fast/learning"
    )
    try:
        publish(parser.parse_args().study)
    except InnerattnError as error:
        sys.exit(str(error))


def publish(folder: Path) -> None:
    """Put the report of a study into its page, and its runs into an archive.

    Raises:
        InnerattnError: there is no such study, report or place; nothing is changed then.
    """
    study = open_study(folder)
    made = folder.name, study.study.grid[0].budgets[0]
    report = folder / report_name(folder.name)
    if made not in PLACES.keys() | TABLES.keys():
        places = ", ".join(f"{target} of {budget}" for target, budget in (*PLACES, *TABLES))
        raise RunError(f"{folder}: there is no place for {made[0]} of {made[1]}, only for {places}")
    if not report.exists():
        raise RunError(f"{report}: missing; `innerattn reproduce {made[0]}` writes it")
    runs = read_results(study).runs
    if made in TABLES:
        publish_tables(report, *TABLES[made])
        if made in KEPT:
            archive = DOCS / "records" / f"{KEPT[made]}.parquet"
            known = {run.folder.name: run for run in read_archive(archive)}
            found = known | {run.folder.name: run for run in runs}
            write_archive((found[name] for name in sorted(found)), archive)
    else:
        page, figures = PLACES[made]
        write_archive(runs, DOCS / "records" / f"{page.stem}.parquet")
        publish_report(report, page, figures)


def report_name(target: str) -> str:
    """The file of a target's report."""
    own = TARGETS[target].report
    return "report.md" if own is None or target == "all" else f"{target}.md"


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


if __name__ == "__main__":
    main()
