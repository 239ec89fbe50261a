"""`innerattn study`: runs, measures and compares what a file lists."""

from __future__ import annotations

import re
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from innerattn.cli.options import LongCommand, UsageError
from innerattn.cli.progress import SeveralMeasurements, Work

if TYPE_CHECKING:
    from rich.console import Console

    from innerattn.experiments.processes import Job
    from innerattn.experiments.run import FinishedRun
    from innerattn.report.study.page import Found
    from innerattn.studies.folder import StudyFolder
    from innerattn.studies.ledger import State
    from innerattn.studies.results import Results
    from innerattn.studies.search.state import Now
    from innerattn.studies.work import Outcome

_TIME = re.compile(r"([0-9]{1,6})([smh])")
_MOST_SHOWN = 500
"""Finished runs whose scores `status` reads; more would make it slow."""
_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0}
Action = Literal["run", "work", "status", "report", "retry", "slurm"]
_WHAT = """What to do.
- run: begin or go on with the study in a file, with a worker for each core.
- work: be one worker for a study that has begun.
- status: how many runs are done, how long the others will take, and their scores so far.
- report: write the report again, as Markdown and JSON, and the scores for other tools.
- retry: let runs that were given up be tried again; run does them.
- slurm: print a script for sbatch whose jobs are workers."""


@dataclass(kw_only=True)
class Study(LongCommand):
    """Train, measure and compare the runs that a file lists, on one or more cores."""

    action: Annotated[tyro.conf.Positional[Action], tyro.conf.arg(help=_WHAT)]
    study: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY")]
    """The study's file (.toml), or its folder once it has begun."""
    out: Path | None = None
    """Folder of the study in a file; None: studies/NAME for NAME.toml."""
    pool: Path | None = None
    """Folder whose runs the study shares with others (run); None: its own."""
    workers: int | None = None
    """How many workers (run) or jobs (slurm); None: one for each core, also of a cluster, or 10
    jobs."""
    ray: str | None = None
    """Run workers on a Ray cluster (run): its address, or local for one of this machine alone."""
    gpus: float = 0.0
    """What each worker on Ray has of a GPU (run)."""
    until: str | None = None
    """Time after which workers save their runs and end (run, work): 90s, 55m, 2h."""
    minutes: int = 60
    """Time limit of a job (slurm) [min]."""
    publish: Path | None = None
    """Folder in which the pages that the file names take sections of the report, and archives its
    runs (run, report)."""

    def run(self) -> int:
        """Do it.

        Returns:
            The exit code: 0, or 1 where a run has failed.

        Raises:
            InnerattnError: the file is not valid, there is no study, or workers cannot run.
            OSError: a file cannot be read or written.
            KeyboardInterrupt: the user stopped it; every worker has saved its run.
        """
        return getattr(self, f"_{self.action}")()  # type: ignore[no-any-return]

    def _run(self) -> int:
        if not 0.0 <= self.gpus <= 64.0:
            raise UsageError(f"--gpus = {self.gpus:g}: must be 0 to 64")
        if self.workers is not None and not 1 <= self.workers <= 256:
            raise UsageError(f"--workers = {self.workers}: must be 1 to 256")
        most_s = None if self.until is None else _seconds(self.until)
        from innerattn.studies.afterwards import to_measure

        study = self._begun()
        if self.publish is not None:
            from innerattn.report.study.publish import asked_pages

            asked_pages(study, self.publish)  # before hours of training, not after
        do_runs(self, study, workers=self.workers, ray=self.ray, gpus=self.gpus, most_s=most_s)
        failed = do_jobs(self, to_measure(study), self.workers)
        return max(self._report(study), int(bool(failed)))

    def _work(self) -> int:
        from innerattn.studies.search.state import Watched
        from innerattn.studies.work import work

        until = None if self.until is None else time.monotonic() + _seconds(self.until)
        study = self._begun()
        console = self.console()

        def ended(outcome: Outcome) -> None:
            if outcome.state == "failed":
                print(f"innerattn: error: {outcome.run}: {outcome.reason}", file=sys.stderr)
            console.print(f"{outcome.run}: {outcome.state}", soft_wrap=True)

        refuse_without_optuna(study)
        work(study.ledger(), Watched(study).to_do(), until=until, ended=ended)
        return 0

    def _status(self) -> int:
        from innerattn.report.study.page import means_table
        from innerattn.report.table import print_table
        from innerattn.studies.duration import duration_of, in_words
        from innerattn.studies.results import means, read_summaries
        from innerattn.studies.search.state import Watched

        now = Watched(self._opened()).now()
        study, states = now.study, now.states
        counts = Counter(states.values())
        names: tuple[State, ...] = ("done", "claimed", "planned", "failed")
        words = {"claimed": "running", "planned": "waiting"}
        told = ", ".join(f"{counts[name]} {words.get(name, name)}" for name in names)
        print(f"{study.path}: {len(states)} runs: {told}")
        found = duration_of(study.pool, states, now.left)
        if found is not None and found.left_s:
            workers = "one worker" if found.workers < 2 else f"{found.workers} workers"
            about = "about" if now.search is None else "at most"
            print(
                f"A run takes {in_words(found.run_s)}; {workers} will need {about} "
                f"{in_words(found.left_s)} more."
            )
        if now.search is not None:
            self._print_search(now)
        elif 0 < counts["done"] <= _MOST_SHOWN:
            print_table(self.console(), means_table(means(read_summaries(study))))
        elif counts["done"]:
            print(f"innerattn study report {study.path} writes their table.")
        self._print_failures(study, states)
        return int(counts["failed"] > 0)

    def _print_search(self, now: Now) -> None:
        from innerattn.report.study.search import search_found, search_sentences, search_table
        from innerattn.report.table import print_table

        found = search_found(now, ())
        print_table(self.console(), search_table(found, cost=False), dense=True)
        for text in search_sentences(found):
            self.console().print(text.replace("**", ""), soft_wrap=True)

    def _report(self, study: StudyFolder | None = None) -> int:
        from innerattn.report.study.write import write_study
        from innerattn.studies.results import read_results
        from innerattn.studies.search.state import Watched

        now = Watched(study or self._opened()).now()
        study = now.study
        found, files = write_study(study, results := read_results(study), now)
        code = say_report(self, found, files)
        if self.publish is not None:
            publish_report(self, study, files[0], results.runs, self.publish)
        return code

    def _retry(self) -> int:
        from innerattn.studies.search.state import Watched

        study = Watched(self._opened()).now().study
        again = set(study.ledger().retry(study.keys))
        for run in study.to_do:
            if run.key in again:
                print(f"{run}: will be tried again")
        count = f"{len(again)} run{'s' * (len(again) != 1)}"
        print(f"{count} to try again" + (f": innerattn study run {study.path}" if again else ""))
        return 0

    def _slurm(self) -> int:
        from innerattn.studies.launch.slurm import slurm_script

        if self.minutes <= 5:
            raise UsageError(f"--minutes = {self.minutes}: must be above 5")
        jobs = 10 if self.workers is None else self.workers
        if not 1 <= jobs <= 10_000:
            raise UsageError(f"--workers = {jobs}: must be 1 to 10,000 jobs")
        print(slurm_script(self._begun().path, jobs, self.minutes), end="")
        return 0

    def _begun(self) -> StudyFolder:
        """The study in a folder, or that of a file, which begins here where it has not begun."""
        from innerattn.studies.folder import begin_study

        return (
            self._opened()
            if self.study.is_dir()
            else begin_study(self.study, self._folder(), pool=self.pool)
        )

    def _opened(self) -> StudyFolder:
        """The study in a folder, or that of a file, which has begun; nothing is written."""
        from innerattn.studies.folder import open_study

        return open_study(self._folder())

    def _folder(self) -> Path:
        if self.study.is_dir():
            return self.study
        if self.study.suffix != ".toml":
            raise UsageError(f"{self.study}: must be a TOML file, or the folder of a study")
        return self.out or Path("studies") / self.study.stem

    def _print_failures(self, study: StudyFolder, states: Mapping[str, State]) -> None:
        from innerattn.studies.results import last_line

        ledger = study.ledger()
        for run in study.to_do:
            if states[run.key] == "failed":
                reason = last_line(ledger.failures(run.key)[-1])
                print(f"innerattn: failed: {run}: {reason}", file=sys.stderr)


def do_runs(
    command: LongCommand,
    study: StudyFolder,
    *,
    workers: int | None = None,
    ray: str | None = None,
    gpus: float = 0.0,
    most_s: float | None = None,
) -> None:
    """Do what is left of a study, and show how far it is; see `innerattn study run`.

    Raises:
        InnerattnError: the first run cannot be trained here, or workers cannot run.
        OSError: a file cannot be read or written.
        KeyboardInterrupt: the user stopped it; every worker has saved its run.
    """
    from innerattn.experiments.processes import places
    from innerattn.experiments.side_by_side import Run, refuse_what_cannot_run
    from innerattn.studies.launch.local import run_workers
    from innerattn.studies.launch.ray import run_workers_on_ray
    from innerattn.studies.search.state import Watched

    watched = Watched(study)
    now = watched.now()
    over, left = Counter(now.states.values()), now.left
    count = workers or places(left)
    by = f" by {count} worker{'s' * (count > 1)}" if ray is None else f" by workers on Ray, {ray}"
    of = len(study.keys) if now.search is None else sum(over.values()) - over["planned"]
    most = "" if now.search is None else "at most "
    command.console().print(
        f"{study.path}: {of} run{'s' * (of != 1)}, {over['done']} done, {over['failed']} failed, "
        f"{most}{left} to do" + (by if left else ""),
        soft_wrap=True,
    )
    if not left:
        return
    refuse_without_optuna(study)
    if ray is None:
        refuse_what_cannot_run([Run((study.to_do or study.planned)[0].config, study.pool / "none")])
    with _Progress(command.progress_console()) as progress:

        def now_left() -> int:
            return progress(watched.now())

        if ray is None:
            run_workers(study.path, count, left=now_left, most_s=most_s)
        else:
            run_workers_on_ray(*(study.path, workers, ray), gpus=gpus, left=now_left, most_s=most_s)


def do_jobs(command: LongCommand, jobs: Sequence[Job], workers: int | None = None) -> list[Job]:
    """Measure finished runs, side by side, and show how far it is.

    Args:
        command: that shows it.
        jobs: what is to be done.
        workers: processes at a time; None: one for each core.

    Returns:
        What failed; standard error says why.

    Raises:
        KeyboardInterrupt: the user stopped it; what is done is kept.
    """
    from innerattn.experiments.processes import places, run_side_by_side

    def failed(job: Job) -> None:
        print(f"innerattn: error: {job}: {job.failure}", file=sys.stderr)

    if jobs:
        with SeveralMeasurements(command.progress_console()) as progress:
            run_side_by_side(
                jobs,
                workers or places(len(jobs)),
                changed=progress,
                failed=failed,
                debug=command.debug,
            )
    return [job for job in jobs if job.state != "done"]


def refuse_without_optuna(study: StudyFolder) -> None:
    """Find out in time that a search has nobody who proposes values.

    Raises:
        MissingLibraryError: the study has a search, and Optuna is not installed.
    """
    if study.study.search is not None:
        from innerattn.studies.search.optuna import load_optuna

        load_optuna()


def say_report(command: LongCommand, found: Found, files: Sequence[Path]) -> int:
    """Print what the report of a study says.

    Returns:
        The exit code: 0, or 1 where a run has failed or cannot be read.
    """
    from innerattn.report.study.page import answers, left_out, means_table
    from innerattn.report.study.search import search_table
    from innerattn.report.table import print_table

    console = command.console()
    for _, rows in found.tables.values():
        if rows:
            print_table(console, means_table(rows), dense=True)
    if found.search is not None:
        print_table(console, search_table(found.search), dense=True)
    for text in answers(found):
        console.print(text.replace("**", ""), soft_wrap=True)
    reasons = [reason for _, reason in found.results.left_out]
    if reasons:
        console.print("Runs that are not in it", style="bold")
    for text in left_out(found.results):
        console.print(f"  {text}", soft_wrap=True, markup=False)
    console.print(
        f"Written: {files[0]}, {', '.join(one.name for one in files[1:])}", soft_wrap=True
    )
    if found.note:
        console.print(found.note[:1].upper() + found.note[1:], style="bold")
    done = sum(state == "done" for state in found.states.values())
    command.say_result(f"{found.study.path}: {done} of {len(found.states)} runs done")
    return int(any(one.startswith(("failed", "unreadable")) for one in reasons))


def publish_report(
    command: LongCommand,
    study: StudyFolder,
    report: Path,
    runs: Sequence[FinishedRun],
    root: Path,
) -> None:
    """Put a report into the pages of its study below ``root``, and name them.

    Raises:
        RunError: something is missing; no page is changed.
        OSError: a file cannot be read or written.
    """
    from innerattn.report.study.publish import publish

    written = ", ".join(map(str, publish(study, report, runs, root)))
    command.console().print(f"Filled: {written}", soft_wrap=True, markup=False)


def print_means(console: Console, results: Results) -> None:
    """Print rescues and scores of finished runs, means over seeds."""
    from innerattn.report.study.page import means_table
    from innerattn.report.table import print_table
    from innerattn.studies.results import means

    if results.finished:
        print_table(console, means_table(means(results.finished)), dense=True)


def say_written(console: Console, files: Sequence[Path]) -> None:
    """Name the files of one folder."""
    if files:
        others = "".join(f", {one.name}" for one in files[1:])
        console.print(f"Written: {files[0]}{others}", soft_wrap=True)


class _Progress(Work):
    """Shows how many runs are done."""

    title = "study"

    def __call__(self, now: Now) -> int:
        """Show how far it is; gives how many runs are left."""
        counts = Counter(now.states.values())
        over = counts["done"] + counts["failed"]
        most = "" if now.search is None else "at most "
        note = f"{counts['done']} of {most}{over + now.left} runs done, {counts['claimed']} running"
        note += f", {counts['failed']} failed" if counts["failed"] else ""
        if over:
            self.show(over, over + now.left, note)
        return now.left


def _seconds(text: str) -> float:
    match = _TIME.fullmatch(text)
    if match is None:
        raise UsageError(f"--until = {text!r}: must be a time such as 90s, 55m or 2h")
    return float(match[1]) * _UNITS[match[2]]
