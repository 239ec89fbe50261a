"""`innerattn reproduce`: a shipped study, trained where runs are missing, then reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import tyro

from innerattn.cli.options import LongCommand, UsageError, check_target
from innerattn.cli.study import (
    do_jobs,
    do_runs,
    print_means,
    publish_report,
    say_report,
    say_written,
)
from innerattn.config import BUDGETS
from innerattn.config.files import write_whole
from innerattn.config.near import did_you_mean
from innerattn.experiments.plan import SITUATIONS
from innerattn.experiments.smoke import smoke_note
from innerattn.report.targets import TARGETS, Report, Target, write_special

if TYPE_CHECKING:
    from innerattn.experiments.processes import Job
    from innerattn.experiments.run import FinishedRun
    from innerattn.studies.folder import StudyFolder
    from innerattn.studies.results import Results

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
    """Folder of the runs, which targets share, and of the report in TARGET; None: studies/BUDGET or
    studies/crossed-BUDGET."""
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
    publish: Path | None = None
    """Folder, such as docs, in which the pages of the target's study take sections of its report;
    see [report] in docs/studies.md."""

    def run(self) -> int:
        """Plan, train, print, write.

        Returns:
            The exit code: 0, or 1 where a run failed or is left out.

        Raises:
            InnerattnError: wrong options, or matplotlib is needed and not installed.
            OSError: a file cannot be written.
            KeyboardInterrupt: the user stopped it; runs are saved.
        """
        from innerattn.report.plots.drawing import check_format
        from innerattn.report.study.write import write_study
        from innerattn.studies.results import read_results

        target = TARGETS[self.target]
        if self.publish is not None and self.target != "all" and target.file == TARGETS["all"].file:
            raise UsageError(f"--publish: pages show all of the paper, not {self.target}: use all")
        report = None if target.report is None else target.report()
        if report is not None and any(name.endswith(".png") for name in report.files):
            check_format(Path("figure.png"))
        study = self._begun(target)
        self._check_page(study)  # before hours of training, not after
        if self.publish is not None:
            from innerattn.report.study.publish import asked_pages

            asked_pages(study, self.publish)
        study.take_over()
        if not self.report_only:
            do_runs(self, study)
        page = self.page is not None
        results = read_results(
            study, steps=target.steps or page, archived=target.archived and not page
        )
        runs = results.runs
        if report is None:
            code, name = say_report(self, *write_study(study, results)), "report.md"
        else:
            code = self._special(target, report, study, results)
            name = next(one for one in report.files if one.endswith(".md"))
        if self.publish is not None:
            publish_report(self, study, study.path / name, runs, self.publish)
        note = smoke_note(self.budget)
        say_written(self.console(), self._write_page(runs, [note] if note else []))
        return int(code or bool(results.left_out))

    def _begun(self, target: Target) -> StudyFolder:
        from innerattn.studies.folder import begin_study_in
        from innerattn.studies.shipped import as_file, narrowed

        methods, presets = target.methods, target.situations
        if self.methods != "all":
            methods = _chosen("methods", self.methods, target.known)
        if self.presets != "all":
            presets = _chosen("presets", self.presets, (*target.situations, *SITUATIONS))
        if not 1 <= self.seeds <= _MOST_SEEDS:
            raise UsageError(f"--seeds = {self.seeds}: must be 1 to {_MOST_SEEDS:,}")
        table = narrowed(
            target.table,
            methods=methods,
            scenarios=presets,
            budget=self.budget,
            seeds=self.seeds,
            device=self.device,
        )
        pool = self.out or Path("studies") / f"{target.pool}{self.budget}"
        out = pool / target.name
        return begin_study_in(as_file(table), Path(f"{target.name}.toml"), out, pool=pool)

    def _special(self, target: Target, report: Report, study: StudyFolder, results: Results) -> int:
        """Write a report of the target's own, and print what its runs scored."""
        from innerattn.report.study.page import left_out

        jobs = self._measured(target, study, results)
        reasons = left_out(results)
        reasons += [f"{job}: {job.failure or 'not measured'}" for job in jobs]
        files = write_special(report, results.runs, study.path, self.budget, reasons)
        console = self.console()
        print_means(console, results)
        if reasons:
            console.print("Runs that are not in it", style="bold")
        for reason in reasons:
            console.print(f"  {reason}", soft_wrap=True, markup=False)
        say_written(console, files)
        note = smoke_note(self.budget)
        if note:
            console.print(note[:1].upper() + note[1:], style="bold")
        done = len({one.run.key for one in results.finished})
        self.say_result(f"{self.target}: {done} of {len(study.keys)} runs done")
        return int(bool(reasons))

    def _measured(self, target: Target, study: StudyFolder, results: Results) -> list[Job]:
        """Do what is to be done with finished runs, unless only a report is asked for.

        Returns:
            What is not done.
        """
        from innerattn.experiments.robustness.measurement import missing_measurements

        if not target.under_faults:
            return []
        cases = [run.case for run in study.planned]
        jobs = missing_measurements(cases, results.runs, study.path)
        return [*jobs] if self.report_only else do_jobs(self, jobs)

    def _check_page(self, study: StudyFolder) -> None:
        """Refuse a page that could not be written after all."""
        if self.page is None:
            return
        if self.page.suffix != ".html":
            raise UsageError(f"--page {self.page}: must end in .html")
        cases = {(run.case.worlds, run.case.method, run.case.seed) for run in study.planned}
        if len(cases) < len(study.planned):
            raise UsageError(f"--page: runs of {self.target} differ by more than a page tells")
        check_target(self.page)

    def _write_page(self, runs: Sequence[FinishedRun], notes: Sequence[str]) -> list[Path]:
        if self.page is None or not runs:
            return []
        from innerattn.report.runs import runs_page

        write_whole(self.page, runs_page(runs, notes=notes).encode())
        return [self.page]


def _chosen(option: str, text: str, known: Sequence[str]) -> tuple[str, ...]:
    """The names that ``text`` lists, in the order of ``known``."""
    known = tuple(dict.fromkeys(known))
    names = {name.strip() for name in text.split(",")}
    if names == {"all"}:
        return known
    unknown = sorted(names - set(known))
    if unknown:
        near = did_you_mean(unknown[0], known)
        raise UsageError(f"--{option} = {unknown[0]!r}: must be all or of {', '.join(known)}{near}")
    return tuple(name for name in known if name in names)
