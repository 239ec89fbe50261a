"""What the finished runs of a study found: means by place in the grid, and its contrasts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json
from innerattn.errors import InnerattnError, RunError, one_line
from innerattn.experiments.run import FinishedRun, check_summary, read_run
from innerattn.records.run_files import RunFiles
from innerattn.stats import Estimate
from innerattn.stats.aggregate import improvement_interval
from innerattn.stats.comparison import ALPHA, Contrast, contrast, holm
from innerattn.stats.seeds import seed_estimate
from innerattn.studies.afterwards import documents, measured
from innerattn.studies.folder import StudyFolder
from innerattn.studies.ledger import Ledger, State
from innerattn.studies.plan import (
    MEASURES_OF_ALL,
    SCORE_AS_SEEN,
    TIMES,
    PlannedRun,
    pairs,
    run_digest,
)
from innerattn.studies.shown import StudyTable
from innerattn.studies.space import Length, Value
from innerattn.studies.study import (
    SCORES,
    Direction,
    Study,
    StudyContrast,
    coordinates,
    has_own_episodes,
)

LEAST_SEEDS = 3
"""Fewer seeds decide nothing."""

SEEN = "greedy-seen"
"""The script that knows what robots have seen; measured where their sight is limited."""

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
    """A finished run of a study.

    Attributes:
        run: which one.
        summary: its ``evaluation/summary.json``.
        finished: all that is known of it; None where only summaries were read.
        measured: what it was measured in beside its own evaluation, such as faults, by measure;
            empty where it has not been.
    """

    run: PlannedRun
    summary: Mapping[str, Any]
    finished: FinishedRun | None = None
    measured: Mapping[str, float | None] = field(default_factory=dict)

    def value(self, measure: str, length: Length) -> float | None:
        """A measure of the run; None where it does not determine it."""
        part = self.summary if length == "standard" else self.summary["long"]
        found: Any
        if has_own_episodes(measure):
            found = self.measured.get(measure)
        elif measure in TIMES:
            info = None if self.finished is None else self.finished.info
            found = getattr(info, TIMES[measure], None)
        elif measure == SCORE_AS_SEEN:
            found = score_as_seen(part)
        elif measure in MEASURES_OF_ALL:
            found = part[measure]
        else:
            found = part["measures"][self.run.config.train.method].get(measure)
        value = found["mean"] if isinstance(found, Mapping) else found
        return None if value is None or not math.isfinite(value) else float(value)


def score_as_seen(part: Mapping[str, Any]) -> float | None:
    """The score, whose 1 is the script that knows what robots have seen, where sight is limited."""
    if SEEN not in part["scripted"]:
        return None if part["score"] is None else float(part["score"]["mean"])
    least, most = (part["scripted"][name]["mean"] for name in ("random", SEEN))
    rescues = part["rescues_per_episode"]["mean"]
    return float((rescues - least) / (most - least)) if most > least else None


@dataclass(frozen=True)
class Results:
    """What there is of a study's runs.

    Attributes:
        planned: all runs, in the order of the grid.
        finished: likewise.
        left_out: each other run, and why it is not among these.
    """

    planned: tuple[PlannedRun, ...]
    finished: tuple[Result, ...]
    left_out: tuple[tuple[PlannedRun, str], ...]

    @property
    def runs(self) -> list[FinishedRun]:
        """The finished runs as reports take them."""
        return [one.finished for one in self.finished if one.finished is not None]


@dataclass(frozen=True)
class Values:
    """A measure of the runs of one place in the grid.

    Attributes:
        each: by seed; None where the episodes of a run do not determine it.
        mean: over those that have a value; None without one.
    """

    each: Mapping[int, float | None]
    mean: Estimate | None


@dataclass(frozen=True)
class Mean:
    """What the runs of one place in the grid found.

    Attributes:
        place: coordinates in the grid.
        seeds: of its finished runs.
        values: by measure and length of episodes.
        episode_steps: of either length [control steps].
    """

    place: Mapping[str, Value]
    seeds: tuple[int, ...]
    values: Mapping[tuple[str, Length], Values]
    episode_steps: Mapping[Length, int]


@dataclass(frozen=True)
class Compared:
    """A contrast at one pair of places.

    Attributes:
        contrast: what is asked.
        length: of the episodes.
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
    length: Length
    a: Mapping[str, Value]
    b: Mapping[str, Value]
    seeds: tuple[int, ...]
    mean: float | None
    found: Contrast | None
    improvement: Estimate | None = None
    p: float | None = None
    holm_p: float | None = None
    verdict: Verdict = "undecided"

    @property
    def family(self) -> str:
        """Whose p-values are adjusted together; at both lengths there are two."""
        second = self.contrast.length == "both" and self.length == "long"
        return f"{self.contrast.family}, long" if second else self.contrast.family


def read_results(study: StudyFolder, *, steps: bool = False, archived: bool = True) -> Results:
    """What there is of the runs of a study; a run that cannot be read is left out and named.

    Args:
        study: in its folder.
        steps: whether records are to hold what was recorded step by step.
        archived: whether archived runs do, which have neither metrics nor steps.

    Raises:
        RunError: the study's archive is damaged.
        OSError: the ledger cannot be read.
    """
    states, ledger = study.states(), study.ledger()
    finished, left_out = [], list[tuple[PlannedRun, str]]()
    for run in study.planned:
        path = study.runs / run.key
        try:
            if path.exists():
                found = read_run(run.case, path, steps=steps)
                if run_digest(found.config) != run.digest:
                    raise RunError("its configuration is another than its name says")
            elif run.key in study.archived and archived:
                found = replace(study.archived[run.key], case=run.case)
            else:
                left_out.append((run, _why_left_out(run.key, states[run.key], ledger)))
                continue
            found = replace(found, beside=documents(study, run))
            finished.append(Result(run, found.summary, found, measured(study, run)))
        except (InnerattnError, OSError) as error:
            left_out.append((run, f"unreadable: {one_line(error)}"))
    return Results(tuple(study.planned), tuple(finished), tuple(left_out))


def _why_left_out(key: str, state: State, ledger: Ledger) -> str:
    if state == "done":
        return "archived, without metrics and steps"
    if state == "failed":
        return f"failed: {last_line(ledger.failures(key)[-1])}"
    return {"planned": "missing", "claimed": "not finished: a worker has it, or has left it"}[state]


def last_line(reason: str) -> str:
    """The last line of why a run failed, which may be a traceback."""
    return reason.strip().splitlines()[-1]


def read_summaries(study: StudyFolder) -> list[Result]:
    """The finished runs of a study; only summaries are read, so that many take little time.

    Raises:
        RunError: a summary cannot be read, or is none of the run.
    """
    found = []
    for run in study.planned:
        path = study.runs / run.key
        if not path.exists() and run.key in study.archived:
            summary: Mapping[str, Any] = study.archived[run.key].summary
        elif path.exists():
            data = RunFiles(path).read("evaluation/summary.json", MOST_JSON_BYTES)
            try:
                document = parse_json(data)
            except ValueError as error:
                raise RunError(f"{path / 'evaluation/summary.json'}: {error}") from error
            summary = check_summary(path, document, run.config)
        else:
            continue
        found.append(Result(run, summary, measured=measured(study, run)))
    return found


def means(results: Sequence[Result], table: StudyTable = SCORES) -> list[Mean]:
    """Means over seeds of what a table shows, in the order of the grid."""
    groups: dict[tuple[tuple[str, Value], ...], list[Result]] = {}
    for one in chosen(results, table.of):
        groups.setdefault(tuple(one.run.place.items()), []).append(one)
    return [
        Mean(
            dict(place),
            tuple(one.run.seed for one in group),
            {key: _values(group, *key) for key in table.wanted},
            {
                "standard": int(group[0].summary["episode_steps"]),
                "long": int(group[0].summary["long"]["episode_steps"]),
            },
        )
        for place, group in groups.items()
    ]


def chosen(results: Iterable[Result], of: Mapping[str, Any]) -> list[Result]:
    """The runs whose place in the grid has some coordinates."""
    wanted = coordinates(of).items()
    return [one for one in results if wanted <= one.run.place.items()]


def _values(group: Sequence[Result], measure: str, length: Length) -> Values:
    each = {one.run.seed: one.value(measure, length) for one in group}
    return Values(each, seed_estimate(list(each.values())))


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
        for length in wanted.lengths:
            for a, b in pairs(wanted, places):
                of_a, of_b = (by_place.get(tuple(place.items()), {}) for place in (a, b))
                found.append(_compared(wanted, length, a, b, of_a, of_b))
    for family in dict.fromkeys(one.family for one in found):
        own = {
            n: one.p for n, one in enumerate(found) if one.family == family and one.p is not None
        }
        for n, holm_p in zip(own, holm(list(own.values())), strict=True):
            found[n] = _judged(found[n], holm_p)
    return found


def _compared(
    wanted: StudyContrast,
    length: Length,
    a: Mapping[str, Value],
    b: Mapping[str, Value],
    of_a: Mapping[int, Result],
    of_b: Mapping[int, Result],
) -> Compared:
    values: dict[int, tuple[float, float]] = {}
    for seed in sorted(of_a.keys() & of_b.keys()):
        x = of_a[seed].value(wanted.measure, length)
        y = of_b[seed].value(wanted.measure_b or wanted.measure, length)
        if x is not None and y is not None:
            values[seed] = x, y
    differences = [x - y for x, y in values.values()]
    mean = sum(differences) / len(differences) if differences else None
    enough = len(values) >= LEAST_SEEDS
    found = contrast(list(values.values()), (1.0, -1.0), wanted.margin) if enough else None
    p = None if found is None else one_sided(found, wanted.direction)
    sides = ([x for x, _ in values.values()], [y for _, y in values.values()])
    improvement = improvement_interval([sides[0]], [sides[1]], seed=0) if enough else None
    return Compared(wanted, length, a, b, tuple(values), mean, found, improvement, p)


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
