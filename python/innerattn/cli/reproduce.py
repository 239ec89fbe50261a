"""`innerattn reproduce`: train the runs that a table or figure needs, then write it."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import tyro

from innerattn.cli.options import LongCommand, UsageError, check_target
from innerattn.cli.progress import SeveralMeasurements, SeveralRuns
from innerattn.config import BUDGETS
from innerattn.config.files import write_whole
from innerattn.config.near import did_you_mean
from innerattn.experiments.plan import SITUATIONS, PlannedRun, on_device
from innerattn.experiments.smoke import smoke_note
from innerattn.report.tables.experiments import print_scores
from innerattn.report.targets import TARGETS, Target

if TYPE_CHECKING:
    from rich.console import Console

    from innerattn.experiments.lock import StudyLock
    from innerattn.experiments.processes import Job
    from innerattn.experiments.run import FinishedRun
    from innerattn.experiments.scan import RunStatus

    TargetName: TypeAlias = str
    Budget: TypeAlias = str
else:
    TargetName, Budget = Literal[tuple(TARGETS)], Literal[BUDGETS]

_MOST_SEEDS = 1_000
_WHAT = "\n".join(("What to make.", *(f"- {one.name}: {one.shows}." for one in TARGETS.values())))


@dataclass(kw_only=True)
class Reproduce(LongCommand):
    """Reproduce a table, figure or study: train missing runs, then write the report.

    Runs that are there already are kept; the same command goes on with what is missing.
    """

    target: Annotated[tyro.conf.Positional[TargetName], tyro.conf.arg(help=_WHAT)]
    budget: Budget = "quick"
    """Recipe of training; quick: a smoke test, not a result; paper: its settings (few for PPO)."""
    seeds: int = 5
    """How many seeds: 0, 1, ... up to one less."""
    out: Path | None = None
    """Folder of the study, its runs in runs; None: studies/BUDGET or studies/crossed-BUDGET."""
    methods: str = "all"
    """Methods, separated by commas; all: what the target needs."""
    presets: Annotated[str, tyro.conf.arg(aliases=["--situations"])] = "all"
    """Built-in scenarios, separated by commas; all: what the target needs."""
    device: str = "cpu"
    """Where networks are trained: cpu, cuda, cuda:0, ... Runs from any device are reported."""
    report_only: tyro.conf.FlagCreatePairsOff[bool] = False
    """Train and measure nothing: report on the runs that are finished, and name the others."""
    page: Path | None = None
    """Write a page about the finished runs too (.html), see innerattn report."""

    def run(self) -> int:
        """Plan, train, print, write.

        Returns:
            The exit code: 0, or 1 where a run failed or is left out.

        Raises:
            InnerattnError: wrong options, matplotlib is needed and not installed, or another study
                is at work in the same folder.
            OSError: a file cannot be written.
            KeyboardInterrupt: the user stopped it; finished runs are kept.
        """
        target = TARGETS[self.target]
        out = self.out or Path("studies") / f"{target.study}{self.budget}"
        planned = self._planned(target, out)

        from innerattn.experiments.account import write_account
        from innerattn.experiments.lock import StudyLock
        from innerattn.experiments.scan import finished_runs, scan_runs
        from innerattn.experiments.score_means import method_scores
        from innerattn.report.left_out import left_out
        from innerattn.report.plots.drawing import check_format

        page = self.page is not None
        scan = partial(
            scan_runs,
            planned,
            out,
            steps=target.steps or page,
            archived=target.archived and not page,
        )
        self._check_page(planned)  # before hours of training, not after
        if target.draws:
            check_format(out / "figure.png")
        console = self.console()
        with StudyLock.take(out) as lock:
            found = scan()
            self._print_plan(console, found, out)
            try:
                if not self.report_only:
                    self._train(found, out, lock)
                    found = scan()
                jobs = self._measure(target, found, out, lock)
            except KeyboardInterrupt:
                found = scan()
                write_account(out, self.target, self.budget, found)
                _say_what_is_kept(found)
                raise
            write_account(out, self.target, self.budget, found)
            note = smoke_note(self.budget)
            reasons = left_out(found)
            reasons += [f"{job}: {job.failure or 'not measured'}" for job in jobs]
            outputs = target.write(finished_runs(found), out, self.budget, reasons)
            account = write_account(out, self.target, self.budget, found, outputs)
        outputs += self._write_page(finished_runs(found), [*([note] if note else []), *reasons])
        print_scores(console, method_scores(found))
        if reasons:
            console.print("Runs that are not in it", style="bold")
        for reason in reasons:
            console.print(f"  {reason}", soft_wrap=True)
        for path in (*outputs, account):
            console.print(f"Written: {path}", soft_wrap=True)
        if note:
            console.print(note[:1].upper() + note[1:], style="bold")
        finished = sum(one.state == "finished" for one in found)
        runs = f"{finished} of {_count(len(found), 'run')} finished"
        self.say_result(f"{self.target}: {runs}; written: {(*outputs, account)[0]}")
        return int(bool(reasons))

    def _check_page(self, planned: Sequence[PlannedRun]) -> None:
        """Refuse a page that could not be written after all."""
        if self.page is None:
            return
        if self.page.suffix != ".html":
            raise UsageError(f"--page {self.page}: must end in .html")
        cases = {(run.case.situation, run.case.method, run.case.seed) for run in planned}
        if len(cases) < len(planned):
            raise UsageError(f"--page: runs of {self.target} differ by more than a page tells")
        check_target(self.page)

    def _write_page(self, runs: Sequence[FinishedRun], notes: Sequence[str]) -> list[Path]:
        if self.page is None or not runs:
            return []
        from innerattn.report.runs import runs_page

        write_whole(self.page, runs_page(runs, notes=notes).encode())
        return [self.page]

    def _planned(self, target: Target, out: Path) -> list[PlannedRun]:
        methods = target.methods
        if self.methods != "all":
            methods = _chosen("methods", self.methods, (*target.methods, *target.further))
        presets = target.situations
        if self.presets != "all":
            known = tuple(dict.fromkeys((*target.situations, *SITUATIONS)))
            presets = _chosen("presets", self.presets, known)
        if not 1 <= self.seeds <= _MOST_SEEDS:
            raise UsageError(f"--seeds = {self.seeds}: must be 1 to {_MOST_SEEDS:,}")
        planned = target.plan(methods, presets, range(self.seeds), self.budget, out)
        return on_device(planned, self.device)

    def _print_plan(self, console: Console, found: Sequence[RunStatus], out: Path) -> None:
        from innerattn.experiments.processes import places
        from innerattn.experiments.train import to_measure, to_train

        states = Counter(one.state for one in found)
        train, measure = len(to_train(found)), len(to_measure(found))
        count = train + measure
        unused = len(found) - count - states["finished"]
        line = f"{self.target}, budget {self.budget}: {_count(len(found), 'run')} of "
        line += f"{_count(self.seeds, 'seed')}; "
        line += f"{states['finished']} finished, "
        if self.report_only:
            line += f"{count} not"
        else:
            line += f"{train} to train" + (f", {measure} to measure only" if measure else "")
            line += f", {places(count)} at a time" if count else ""
        line += f"; {unused} left out" if unused else ""
        console.print(line, soft_wrap=True)
        note = smoke_note(self.budget)
        if note:
            console.print(note[:1].upper() + note[1:], style="bold")
        console.print(f"Study folder: {out}", soft_wrap=True)
        for one in found:
            if one.state in ("other_configuration", "unreadable"):
                text = f"left out: {one.planned.folder}: {one.reason}"
                _say(f"{text} (move it away to have it trained)")

    def _train(self, found: Sequence[RunStatus], out: Path, lock: StudyLock) -> None:
        from innerattn.experiments.train import train_missing

        with SeveralRuns(self.progress_console()) as progress:
            train_missing(found, out, lock, changed=progress, failed=_say_why, debug=self.debug)

    def _measure(
        self, target: Target, found: Sequence[RunStatus], out: Path, lock: StudyLock
    ) -> list[Job]:
        """Do what is to be done with finished runs, unless only a report is asked for.

        Returns:
            What is not done.
        """
        from innerattn.experiments.processes import places, run_side_by_side

        jobs = target.jobs(found, out) if target.jobs else ()
        if jobs and not self.report_only:
            with SeveralMeasurements(self.progress_console()) as progress:
                run_side_by_side(
                    jobs,
                    places(len(jobs)),
                    changed=progress,
                    failed=lambda job: _say(f"error: {job}: {job.failure}"),
                    debug=self.debug,
                    keep=lock,
                )
        return [job for job in jobs if job.state != "done"]


def _chosen(option: str, text: str, known: Sequence[str]) -> tuple[str, ...]:
    """The names that ``text`` lists, in the order of ``known``."""
    names = {name.strip() for name in text.split(",")}
    if names == {"all"}:
        return tuple(known)
    unknown = sorted(names - set(known))
    if unknown:
        near = did_you_mean(unknown[0], known)
        raise UsageError(f"--{option} = {unknown[0]!r}: must be all or of {', '.join(known)}{near}")
    return tuple(name for name in known if name in names)


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _say_why(planned: PlannedRun, reason: str) -> None:
    _say(f"error: {planned.case}: {reason}")


def _say_what_is_kept(found: Sequence[RunStatus]) -> None:
    done = sum(one.state == "finished" for one in found)
    _say(f"{done} of {len(found)} runs are finished and kept; the same command goes on with them")


def _say(text: str) -> None:
    print(f"innerattn: {text}", file=sys.stderr)
