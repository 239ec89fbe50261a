"""What the report of a study shows, and the pages that take parts of it."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from innerattn.config.model import Model
from innerattn.studies.space import Length

_LONG = ", long"
_MOST_MEASURES = 12

CONTRASTS, OVER_ALL, DATED_RULES = "Contrasts", "Over all scenarios", "Rules"
"""Headings of sections that are neither a table nor a figure of curves."""
HANDOFFS = "Handoffs"
"""That of the figure of attention in the actor."""
OPENING = "opening"
"""What a page calls the text of a report above its first section."""


class Shown(Model):
    """A part of the report."""

    title: str = Field(min_length=1, max_length=100, description="heading in the report")
    of: dict[str, Any] = Field(
        default_factory=dict, description="which runs: coordinates of the grid by value; none: all"
    )


class Curves(Shown):
    """A figure of rescues in training, against env-steps and time."""

    place: ClassVar[str] = "curves"


class StudyTable(Shown):
    """A table of means over seeds, a row for each place in the grid."""

    place: ClassVar[str] = "tables"

    measures: tuple[str, ...] = Field(
        ("rescues_per_episode", "score", "score, long"),
        min_length=1,
        max_length=_MOST_MEASURES,
        description="score, rescues_per_episode or registered measures of a run; ', long' behind "
        "one means episodes of the second length",
    )
    seeds: bool = Field(True, description="whether the value of each seed is shown")

    @property
    def wanted(self) -> list[tuple[str, Length]]:
        """Its measures and their lengths of episodes."""
        return [
            (one.removesuffix(_LONG), "long" if one.endswith(_LONG) else "standard")
            for one in self.measures
        ]


class ReportPage(Model):
    """A part of a Markdown page that sections of the report fill."""

    place: ClassVar[str] = "report.pages"

    page: str = Field(
        pattern=r"^[^/\\].*\.md$", description="the page, below the folder that --publish names"
    )
    part: str = Field(
        pattern=r"^[A-Za-z0-9_-]{1,64}$",
        description="the text between <!-- PART: begin --> and <!-- PART: end --> is replaced",
    )
    sections: tuple[str, ...] = Field(
        (),
        description=f"headings of sections whose text it takes, or {OPENING!r}: what stands above "
        "the first section; none: all sections, with their headings",
    )
    required: bool = Field(
        True, description="whether a report without the first of these sections is refused"
    )
    budget: str | None = Field(None, description="fill it with runs of this recipe only")
    figure: str | None = Field(
        None, description="figure of the report (.png) that the page shows as images/PART.png"
    )
    images: str | None = Field(
        None,
        description="how names of linked figures begin, from the page; none: images/PAGE-",
    )
    archive: str | None = Field(
        None,
        pattern=r"^[^/\\].*\.parquet$",
        description="archive that takes the finished runs, below the same folder",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("page", "archive"):
            path = getattr(self, key)
            if path is not None and ".." in path.split("/"):
                raise ValueError(f"report.pages.{key} = {path!r}: must not lead out with '..'")
        return self


class Report(Model):
    """What the report shows, and which pages take parts of it."""

    place: ClassVar[str] = "report"

    sections: tuple[str, ...] | None = Field(
        None,
        description=f"the sections below the answer, in this order: {CONTRASTS}, titles of tables "
        f"and curves, {HANDOFFS} with [actor_attention], {OVER_ALL}, {DATED_RULES}; none: all",
    )
    pages: tuple[ReportPage, ...] = Field(
        (), max_length=50, description="parts of pages that sections of the report fill"
    )
