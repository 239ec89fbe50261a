"""How far long work is: a bar on a terminal, else a plain line now and then; on standard error."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import cache
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from innerattn.cli.plain import PlainConsole, escaped_output
from innerattn.records.logged import logged_rescues, unit_of_rescues

if TYPE_CHECKING:
    from innerattn.config import RunConfig
    from innerattn.evaluate.robustness import Stage
    from innerattn.evaluate.training_score import ScriptedRescues
    from innerattn.experiments.processes import Job
    from innerattn.train import Progress as TrainProgress

_PLAIN_EVERY_S = 10.0
_STATES = ("running", "done", "failed")
_TELLING = 0.05  # of a job; less says little of the pace, since jobs begin slowly


class Work:
    """Shows one piece of work; a context manager, so that the bar is put away."""

    title = "working"
    tells_from: ClassVar[float] = 0.0
    """Share of the work from which on its pace says how long the rest takes."""

    def __init__(
        self, console: Console | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Show on ``console``; none: standard error. ``clock`` gives seconds."""
        self._console = console or PlainConsole(stderr=True)
        self._clock = clock
        self._start = self._last_line = clock()
        self._bar: Progress | None = None
        self._shown = ExitStack()
        drawn = self._console.is_terminal and not self._console.is_dumb_terminal
        if drawn and not self._console.quiet:
            self._bar = Progress(
                BarColumn(bar_width=16),
                TextColumn("{task.description}"),  # two lines, so that 80 columns hold them
                console=self._console,
                transient=True,
            )
            self._task = self._bar.add_task(self.title, total=1.0)

    def __enter__(self) -> Self:
        """Show the bar, if there is one."""
        if self._bar is not None:
            self._shown.enter_context(self._bar)
            self._shown.enter_context(escaped_output())  # the bar reads colours in what is printed
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Put the bar away."""
        self._shown.close()

    def show(self, done: float, total: float, note: str, worked_s: float = 0.0) -> None:
        """Show that ``done`` of ``total`` units are done, and a note.

        The rest is taken to go at the pace so far. What goes on was begun before this process:
        ``worked_s`` seconds of work were done at least.
        """
        now, known = self._clock(), done > self.tells_from * total
        left_s = max(now - self._start, worked_s) * (total / done - 1.0) if known else None
        self._put(now, done / total, note, left_s)

    def _put(self, now: float, share: float, note: str, left_s: float | None) -> None:
        """Show the share that is done and the time left [s]; none where it is not known yet."""
        share = min(share, 1.0)
        head = f"{self.title} {share:4.0%} | {_clock_text(left_s)} left"
        if self._bar is not None:
            self._bar.update(self._task, completed=share, description=f"{head}\n{note}")
        elif now - self._last_line >= _PLAIN_EVERY_S:
            self._console.print(f"{head} | {note}", soft_wrap=True)
            self._last_line = now


def _clock_text(seconds: float | None) -> str:
    """As M:SS, from an hour on as H:MM:SS."""
    if seconds is None:
        return "-:--"
    minutes, rest = divmod(max(int(seconds), 0), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


class Training(Work):
    """Shows training; call it with each `innerattn.train.Progress`."""

    title = "training"
    tells_from = _TELLING  # the first updates may be compiled

    def __init__(
        self,
        console: Console | None = None,
        clock: Callable[[], float] = time.monotonic,
        scripts: Callable[[], ScriptedRescues] | None = None,
        config: RunConfig | None = None,
    ) -> None:
        """As `Work`; ``scripts`` is called once, when the first score is to be shown.

        ``config`` says what rescues are counted over; none: over episodes.
        """
        super().__init__(console, clock)
        self._scripts = cache(scripts) if scripts is not None else None
        self._config = config
        self._known: float | None = None

    def __call__(self, progress: TrainProgress) -> None:
        """Show how far this stage of training is."""
        if progress.stage != self.title:
            self.title = progress.stage
            self._start = self._clock() - progress.seconds
            self._known = None
        seconds = max(progress.seconds, 1e-9)
        rescues = self._logged(progress.metrics) if progress.metrics else None
        if rescues is not None:  # none where no episode ended in the last interval
            self._known = rescues
        parts = [
            "no episode yet" if self._known is None else self._rescues(self._known),
            f"{progress.env_steps / seconds:,.0f} env-steps/s",
            _agreement(progress) if progress.stage == "imitating" else _loss(progress, seconds),
        ]
        note = " | ".join(parts)
        self.show(progress.env_steps, progress.total_env_steps, note, progress.seconds)

    def _logged(self, line: Mapping[str, Any]) -> float | None:
        if self._config is not None:
            return logged_rescues(self._config, line)
        found: float | None = line["rescues_per_episode"]
        return found

    def _rescues(self, rescues: float) -> str:
        score = None
        if self._scripts is not None and not self._console.quiet:
            score = self._scripts().score(rescues)
        per = "episode" if self._config is None else unit_of_rescues(self._config)
        told = f"{rescues:.2f} rescues/{per}"
        return told if score is None else f"{told}, score {score:.2f}"


def _loss(progress: TrainProgress, seconds: float) -> str:
    losses = progress.metrics.get("losses", {}) if progress.metrics else {}
    if "critic_loss" in losses:
        return f"loss {losses['critic_loss']:.3g}"
    return f"{progress.updates / seconds:,.1f} updates/s"


def _agreement(progress: TrainProgress) -> str:
    losses = progress.metrics["losses"] if progress.metrics else {}
    return f"{losses['agreement']:.0%} as the script" if "agreement" in losses else "no figure yet"


class Evaluating(Work):
    """Shows evaluation; call it with the episodes done and the episodes to do."""

    title = "evaluating"

    def __call__(self, done: int, total: int) -> None:
        """Show how far evaluation is."""
        self.show(done, total, f"{done:,} of {total:,} episodes")


class Planning(Work):
    """Shows planning; call it with the instances done and the instances to do."""

    title = "planning"

    def __call__(self, done: int, total: int) -> None:
        """Show how far planning is."""
        self.show(done, total, f"{done:,} of {total:,} instances")


class MeasuringRobustness(Work):
    """Shows `innerattn.evaluate.robustness.measure_robustness`; call it as that calls back."""

    title = "evaluating"
    _UNITS: ClassVar[Mapping[str, str]] = {
        "evaluating": "episodes",
        "checking bounds": "kinds and sizes of changes",
        "watching attention": "plays of all worlds",
    }

    def __init__(
        self, console: Console | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """As `Work`."""
        super().__init__(console, clock)
        self._last_done, self._last_call = 0, self._start

    def __call__(self, stage: Stage, done: int, total: int) -> None:
        """Show how far a stage is; checking bounds and watching attention begin with each run."""
        if stage != self.title or done <= self._last_done:
            self.title, self._start = stage, self._last_call
        self._last_done, self._last_call = done, self._clock()
        self.show(done, total, f"{done:,} of {total:,} {self._UNITS[stage]}")


class SeveralJobs(Work):
    """Shows jobs side by side; call it with all of them."""

    noun = "jobs"

    def __init__(
        self, console: Console | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """As `Work`."""
        super().__init__(console, clock)
        self._last_call = self._start
        self._busy = self._at_once = 0
        self._spent = 0.0  # on all jobs together, without the time that they take to start [s]

    def __call__(self, jobs: Sequence[Job]) -> None:
        """Show how far the jobs are."""
        now = self._clock()
        self._spent += self._busy * (now - self._last_call)
        self._last_call = now
        self._busy = sum(job.state == "running" and job.share > 0.0 for job in jobs)
        count = {state: sum(job.state == state for job in jobs) for state in _STATES}
        self._at_once = max(self._at_once, count["running"])
        done = sum(job.size * (1.0 if job.state == "failed" else job.share) for job in jobs)
        note = f"{count['done']} of {len(jobs)} {self.noun} done, {count['running']} running"
        if count["failed"]:
            note += f", {count['failed']} failed"
        self._put(now, done / sum(job.size for job in jobs), note, self._left(jobs))

    def _left(self, jobs: Sequence[Job]) -> float | None:
        """Time until the last job is done [s]; each waiting one takes the first free place."""
        progress = sum(job.size * job.share for job in jobs)
        if progress < _TELLING or not self._spent:
            return None
        a_job = self._spent / progress
        running = [job for job in jobs if job.state == "running"]
        places = [(1.0 - job.share) * job.size * a_job for job in running]
        places += [0.0] * (self._at_once - len(places))  # free until the next job is started
        heapq.heapify(places)
        for job in jobs:
            if job.state == "waiting":
                heapq.heapreplace(places, places[0] + job.size * a_job)
        return max(places, default=0.0)


class SeveralRuns(SeveralJobs):
    """Shows runs that are trained side by side, their evaluation included."""

    title, noun = "training", "runs"


class SeveralMeasurements(SeveralJobs):
    """Shows measurements side by side."""

    title, noun = "measuring", "measurements"
