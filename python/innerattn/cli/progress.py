"""How far long work is: a bar on a terminal, else a plain line now and then; on standard error."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

if TYPE_CHECKING:
    from innerattn.study.several import Run
    from innerattn.train import Progress as TrainProgress

_PLAIN_EVERY_S = 10.0
_STATES = ("running", "done", "failed")


class Work:
    """Shows one piece of work; a context manager, so that the bar is put away."""

    title = "working"

    def __init__(
        self, console: Console | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Show on ``console``; none: standard error. ``clock`` gives seconds."""
        self._console = console or Console(stderr=True)
        self._clock = clock
        self._start = self._last_line = clock()
        self._bar: Progress | None = None
        if self._console.is_terminal:
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
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Put the bar away."""
        if self._bar is not None:
            self._bar.stop()

    def show(self, done: float, total: float, note: str, left_s: float | None = None) -> None:
        """Show that ``done`` of ``total`` units are done, and a note.

        Time left is ``left_s``; None: as long as the rest takes at the pace so far.
        """
        now = self._clock()
        share = min(done / total, 1.0)
        if left_s is None and share > 0.0:
            left_s = (now - self._start) * (1.0 / share - 1.0)
        left = "-:--" if left_s is None else f"{int(left_s) // 60}:{int(left_s) % 60:02d}"
        head = f"{self.title} {share:4.0%} | {left} left"
        if self._bar is not None:
            self._bar.update(self._task, completed=share, description=f"{head}\n{note}")
        elif now - self._last_line >= _PLAIN_EVERY_S:
            self._console.print(f"{head} | {note}", soft_wrap=True)
            self._last_line = now


class Training(Work):
    """Shows training; call it with each `innerattn.train.Progress`."""

    title = "training"

    def __call__(self, progress: TrainProgress) -> None:
        """Show how far this stage of training is."""
        if progress.stage != self.title:
            self.title = progress.stage
            self._start = self._clock() - progress.seconds
        seconds = max(progress.seconds, 1e-9)
        rescues = progress.metrics["rescues_per_episode"] if progress.metrics else None
        parts = [
            "no episode yet" if rescues is None else f"{rescues:.2f} rescues/episode",
            f"{progress.env_steps / seconds:,.0f} env-steps/s",
            _agreement(progress)
            if progress.stage == "imitating"
            else f"{progress.updates / seconds:,.1f} updates/s",
        ]
        self.show(progress.env_steps, progress.total_env_steps, " | ".join(parts))


def _agreement(progress: TrainProgress) -> str:
    losses = progress.metrics["losses"] if progress.metrics else {}
    return f"{losses['agreement']:.0%} as the script" if "agreement" in losses else "no figure yet"


class Evaluating(Work):
    """Shows evaluation; call it with the episodes done and the episodes to do."""

    title = "evaluating"

    def __call__(self, done: int, total: int) -> None:
        """Show how far evaluation is."""
        self.show(done, total, f"{done:,} of {total:,} episodes")


class CheckingBounds(Work):
    """Shows the check of bounds; call it with the levels done and the levels to do."""

    title = "checking bounds"

    def __call__(self, done: int, total: int) -> None:
        """Show how far the check of one run is."""
        self.show(done, total, f"{done} of {total} kinds and sizes of changes")


class WatchingAttention(Work):
    """Shows plays for attention; call it with the plays done and the plays to do."""

    title = "watching attention"

    def __call__(self, done: int, total: int) -> None:
        """Show how far the plays of one run are."""
        self.show(done, total, f"{done} of {total} plays of all worlds")


class SeveralRuns(Work):
    """Shows runs side by side, their evaluation included; call it with all of them."""

    title = "training"

    def __init__(
        self, console: Console | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """As `Work`."""
        super().__init__(console, clock)
        self._last_call = self._start
        self._training = self._at_once = 0
        self._spent = 0.0  # on all runs together, without the time that they take to start [s]

    def __call__(self, runs: Sequence[Run]) -> None:
        """Show how far the runs are."""
        now = self._clock()
        self._spent += self._training * (now - self._last_call)
        self._last_call = now
        self._training = sum(run.state == "running" and run.share > 0.0 for run in runs)
        count = {state: sum(run.state == state for run in runs) for state in _STATES}
        self._at_once = max(self._at_once, count["running"])
        done = sum(1.0 if run.state == "failed" else run.share for run in runs)
        note = f"{count['done']} of {len(runs)} runs done, {count['running']} running"
        if count["failed"]:
            note += f", {count['failed']} failed"
        self.show(done, len(runs), note, self._left(runs))

    def _left(self, runs: Sequence[Run]) -> float | None:
        """Time until the last run is done [s]; each waiting one takes the first free place."""
        progress = sum(run.share for run in runs)
        if not (progress and self._spent):
            return None
        a_run = self._spent / progress
        places = [(1.0 - run.share) * a_run for run in runs if run.state == "running"]
        places += [0.0] * (self._at_once - len(places))  # free until the next run is started
        heapq.heapify(places)
        for run in runs:
            if run.state == "waiting":
                heapq.heapreplace(places, places[0] + a_run)
        return max(places, default=0.0)
