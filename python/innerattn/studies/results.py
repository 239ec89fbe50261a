"""What the finished runs of a study found: means by place in the grid, and its contrasts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json
from innerattn.errors import RunError
from innerattn.experiments.plan import Case
from innerattn.experiments.run import check_summary, read_run
from innerattn.records.run_files import RunFiles
from innerattn.stats import Estimate
from innerattn.stats.aggregate import improvement_interval
from innerattn.stats.comparison import ALPHA, Contrast, contrast, holm
from innerattn.stats.seeds import seed_estimate
from innerattn.studies.plan import MEASURES_OF_ALL, PlannedRun, pairs
from innerattn.studies.study import Direction, Length, Study, StudyContrast, Value

LEAST_SEEDS = 3
"""Fewer seeds decide nothing."""

Verdict = Literal["greater", "smaller", "alike", "undecided"]

RULES = f"""\
- **Unit.** The seed is the unit: each gives one difference a - b. Runs of one seed are measured in
  the same worlds. {LEAST_SEEDS} seeds or more decide.
- **Intervals** are 95 %, by Student's t over seeds.
- **Greater** or **smaller**: Holm's p is below 5 %, adjusted for all rows of a family.
- **Alike**: neither, and two one-sided tests at 5 % put the difference within the margin.
- **Undecided**: none of these."""


@dataclass(frozen=True)
class Result:
    """A finished run of a study and its ``evaluation/summary.json``."""

    run: PlannedRun
    summary: Mapping[str, Any]

    def value(self, measure: str, length: Length) -> float | None:
        """A measure of the run; None where its episodes do not determine it."""
        part = self.summary if length == "standard" else self.summary["long"]
        if measure in MEASURES_OF_ALL:
            found = part[measure]
        else:
            found = part["measures"][self.run.config.train.method].get(measure)
        value = found["mean"] if isinstance(found, Mapping) else found
        return None if value is None or not math.isfinite(value) else float(value)


@dataclass(frozen=True)
class Mean:
    """What the runs of one place in the grid found, as means over seeds.

    Attributes:
        place: coordinates in the grid.
        seeds: of its finished runs.
        values: by measure and length; None where no run has the value.
    """

    place: Mapping[str, Value]
    seeds: tuple[int, ...]
    values: Mapping[tuple[str, Length], Estimate | None]


@dataclass(frozen=True)
class Compared:
    """A contrast at one pair of places.

    Attributes:
        contrast: what is asked.
        a: place of the runs.
        b: place of those that they are compared with.
        seeds: those that have a value of both.
        mean: mean difference a - b; None without seeds.
        found: None with fewer than `LEAST_SEEDS` seeds, or where all seeds differ alike.
        improvement: how probably a run of a has a larger value than one of b, whatever their
            seeds; None with fewer than `LEAST_SEEDS` seeds.
        p: of the test that the contrast asks for.
        holm_p: adjusted within its family.
        verdict: by `RULES`.
    """

    contrast: StudyContrast
    a: Mapping[str, Value]
    b: Mapping[str, Value]
    seeds: tuple[int, ...]
    mean: float | None
    found: Contrast | None
    improvement: Estimate | None = None
    p: float | None = None
    holm_p: float | None = None
    verdict: Verdict = "undecided"


def read_results(folder: Path, planned: Iterable[PlannedRun]) -> list[Result]:
    """The finished runs; folders that are not there are left out.

    Args:
        folder: of the finished runs, one for each key.
        planned: the runs of the study.

    Raises:
        RunError: a finished run cannot be read, or was measured otherwise than planned.
        OSError: a file cannot be read.
    """
    found = []
    for run in planned:
        path = folder / run.key
        if path.exists():
            case = Case(run.config.scenario.situation, run.config.train.method, run.seed)
            found.append(Result(run, read_run(case, path, steps=False).summary))
    return found


def read_summaries(folder: Path, planned: Iterable[PlannedRun]) -> list[Result]:
    """As `read_results`, but only summaries are read, so that many runs take little time.

    Raises:
        RunError: a summary cannot be read, or is none of the run.
    """
    found = []
    for run in planned:
        path = folder / run.key
        if path.exists():
            data = RunFiles(path).read("evaluation/summary.json", MOST_JSON_BYTES)
            try:
                document = parse_json(data)
            except ValueError as error:
                raise RunError(f"{path / 'evaluation/summary.json'}: {error}") from error
            found.append(Result(run, check_summary(path, document, run.config)))
    return found


def means(results: Sequence[Result]) -> list[Mean]:
    """Means over seeds of what every study shows, in the order of the grid."""
    wanted: list[tuple[str, Length]] = [
        ("rescues_per_episode", "standard"),
        ("score", "standard"),
        ("score", "long"),
    ]
    groups: dict[tuple[tuple[str, Value], ...], list[Result]] = {}
    for one in results:
        groups.setdefault(tuple(one.run.place.items()), []).append(one)
    return [
        Mean(
            dict(place),
            tuple(one.run.seed for one in group),
            {key: seed_estimate([one.value(*key) for one in group]) for key in wanted},
        )
        for place, group in groups.items()
    ]


def compare(
    study: Study, planned: Sequence[PlannedRun], results: Sequence[Result]
) -> list[Compared]:
    """All contrasts of a study, judged by its rules."""
    by_place: dict[tuple[tuple[str, Value], ...], dict[int, Result]] = {}
    for one in results:
        by_place.setdefault(tuple(one.run.place.items()), {})[one.run.seed] = one
    found = []
    places = list({tuple(run.place.items()): run.place for run in planned}.values())
    for wanted in study.contrasts:
        for a, b in pairs(wanted, places):
            of_a, of_b = (by_place.get(tuple(place.items()), {}) for place in (a, b))
            found.append(_compared(wanted, a, b, of_a, of_b))
    for family in dict.fromkeys(one.contrast.family for one in found):
        own = {
            n: one.p
            for n, one in enumerate(found)
            if one.contrast.family == family and one.p is not None
        }
        for n, holm_p in zip(own, holm(list(own.values())), strict=True):
            found[n] = _judged(found[n], holm_p)
    return found


def _compared(
    wanted: StudyContrast,
    a: Mapping[str, Value],
    b: Mapping[str, Value],
    of_a: Mapping[int, Result],
    of_b: Mapping[int, Result],
) -> Compared:
    values: dict[int, tuple[float, float]] = {}
    for seed in sorted(of_a.keys() & of_b.keys()):
        x, y = (one.value(wanted.measure, wanted.length) for one in (of_a[seed], of_b[seed]))
        if x is not None and y is not None:
            values[seed] = x, y
    differences = [x - y for x, y in values.values()]
    mean = sum(differences) / len(differences) if differences else None
    enough = len(values) >= LEAST_SEEDS
    found = contrast(list(values.values()), (1.0, -1.0), wanted.margin) if enough else None
    p = None if found is None else one_sided(found, wanted.direction)
    sides = ([x for x, _ in values.values()], [y for _, y in values.values()])
    improvement = improvement_interval([sides[0]], [sides[1]], seed=0) if enough else None
    return Compared(wanted, a, b, tuple(values), mean, found, improvement, p)


def one_sided(found: Contrast, direction: Direction) -> float:
    """The p-value of a t-test in a direction, from the two-sided one."""
    if direction == "two-sided":
        return found.p
    as_asked = (found.difference.mean > 0.0) == (direction == "greater")
    return found.p / 2.0 if as_asked else 1.0 - found.p / 2.0


def _judged(one: Compared, holm_p: float) -> Compared:
    assert one.found is not None  # it has a p-value
    verdict: Verdict = "undecided"
    if holm_p < ALPHA:
        verdict = "greater" if one.found.difference.mean > 0.0 else "smaller"
    elif one.found.equivalent:
        verdict = "alike"
    return replace(one, holm_p=holm_p, verdict=verdict)
