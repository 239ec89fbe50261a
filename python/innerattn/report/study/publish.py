"""Sections of a report as parts of pages, as the file of its study asks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from innerattn.config.files import write_whole
from innerattn.errors import RunError
from innerattn.experiments.archive import read_archive, write_archive
from innerattn.experiments.run import FinishedRun
from innerattn.report.marks import fill, marked
from innerattn.studies.folder import StudyFolder
from innerattn.studies.shown import OPENING, ReportPage

_LINK = re.compile(r"\]\(([^)/:#]+)\)")
"""A link to a file beside the report."""


@dataclass(frozen=True)
class _Filled:
    """A part of a page, and what it needs.

    Attributes:
        page: the file.
        part: name of its part.
        text: what goes there.
        files: copies by source.
    """

    page: Path
    part: str
    text: str
    files: Mapping[Path, Path]


def asked_pages(study: StudyFolder, root: Path) -> list[ReportPage]:
    """The parts of pages below ``root`` that sections of a study's report are to fill.

    Raises:
        RunError: the file of the study names none for its runs, or a page or its part is missing.
        OSError: a page cannot be read.
    """
    asked = study.study.report
    budgets = set(study.study.grid[0].budgets)
    pages = [
        one
        for one in (() if asked is None else asked.pages)
        if one.budget is None or {one.budget} == budgets
    ]
    if not pages:
        of = f" for {', '.join(sorted(budgets))}" if asked and asked.pages else ""
        raise RunError(f"{study.path}: [[report.pages]] of its file names no page{of}")
    for one in pages:
        page = root / one.page
        if not page.exists():
            raise RunError(f"{page}: missing; --publish names the folder of the pages")
        marked(page, one.part)
    return pages


def publish(
    study: StudyFolder, report: Path, runs: Sequence[FinishedRun], root: Path
) -> list[Path]:
    """Put sections of a report into parts of pages, with figures, and its runs into archives.

    Figures that the text links go to ``images`` beside the page, other files to a folder of the
    page in ``tables``. An archive keeps the runs that it has already.

    Args:
        study: in its folder; the ``report`` of its file names the pages.
        report: its report, a Markdown file.
        runs: its finished runs.
        root: folder that the paths of pages and archives begin in.

    Returns:
        The pages and archives that were written.

    Raises:
        RunError: as of `asked_pages`; the report, a section or a linked file is missing; or the
            archive cannot take the runs. No page is changed then.
        OSError: a file cannot be read or written; each is written whole or not at all.
    """
    pages = asked_pages(study, root)
    if not report.exists():
        raise RunError(f"{report}: missing; write the report first")
    found = _sections(report.read_text("utf-8"))
    filled = [one for page in pages if (one := _filled(page, *found, report, root)) is not None]
    if not filled:
        raise RunError(f"{report}: has none of the sections that its pages take; runs are missing")
    archives = dict.fromkeys(root / one.archive for one in pages if one.archive is not None)
    for archive in archives:
        _add(runs, archive)
    for one in filled:
        for source, target in one.files.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            write_whole(target, source.read_bytes())
        fill(one.page, one.part, one.text)
    return [*dict.fromkeys(one.page for one in filled), *archives]


def _filled(
    asked: ReportPage, opening: str, sections: Mapping[str, str], report: Path, root: Path
) -> _Filled | None:
    """A part of a page; None where the report may lack it, and does.

    Raises:
        RunError: a section or a linked file is missing.
    """
    page = root / asked.page
    if not asked.sections:
        part = "\n\n".join(f"## {heading}\n\n{own}" for heading, own in sections.items())
    else:
        found = {OPENING: opening, **sections}
        if asked.sections[0] not in found:
            if asked.required:
                raise RunError(f"{report}: has no section {asked.sections[0]!r}; runs are missing")
            return None
        part = "\n\n".join(found[one] for one in asked.sections if one in found)
    images = asked.images if asked.images is not None else f"images/{page.stem}-"
    files: dict[Path, Path] = {}

    def placed(link: re.Match[str]) -> str:
        name = link[1]
        is_image = name.endswith((".png", ".svg"))
        new = f"{images}{name}" if is_image else f"tables/{page.stem}/{name}"
        kinds = (".png", ".pdf") if name.endswith(".png") else (Path(name).suffix,)
        for kind in kinds:
            source = (report.parent / name).with_suffix(kind)
            files[_there(source)] = (page.parent / new).with_suffix(kind)
        return f"]({new})"

    part = _LINK.sub(placed, part)
    if asked.figure is not None:
        files[_there(report.parent / asked.figure)] = page.parent / f"images/{asked.part}.png"
    return _Filled(page, asked.part, part, files)


def _there(source: Path) -> Path:
    if not source.exists():
        raise RunError(f"{source}: missing; write the report again")
    return source


def _sections(report: str) -> tuple[str, dict[str, str]]:
    """What stands between title and first section, and the text of each section by its heading."""
    opening, *parts = re.split("^## ", report, flags=re.MULTILINE)
    split = (part.partition("\n") for part in parts)
    opening = re.sub("^# .*\n", "", opening, count=1, flags=re.MULTILINE)
    return opening.strip(), {heading: text.strip() for heading, _, text in split}


def _add(runs: Sequence[FinishedRun], archive: Path) -> None:
    """Add runs to an archive, which may not be there yet."""
    known = read_archive(archive) if archive.exists() else []
    found = {run.folder.name: run for run in (*known, *runs)}
    write_archive((found[name] for name in sorted(found)), archive)
