"""How far long work is: a bar on a terminal, else a plain line now and then; on standard error."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

if TYPE_CHECKING:
    from innerattn.train import Progress as TrainProgress

_PLAIN_EVERY_S = 10.0


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

    def show(self, done: int, total: int, note: str) -> None:
        """Show that ``done`` of ``total`` units are done, and a note."""
        now = self._clock()
        share = min(done / total, 1.0)
        left = int((now - self._start) * (1.0 / share - 1.0)) if share > 0.0 else 0
        head = f"{self.title} {share:4.0%} | {left // 60}:{left % 60:02d} left"
        if self._bar is not None:
            self._bar.update(self._task, completed=share, description=f"{head}\n{note}")
        elif now - self._last_line >= _PLAIN_EVERY_S:
            self._console.print(f"{head} | {note}", soft_wrap=True)
            self._last_line = now


class Training(Work):
    """Shows training; call it with each `innerattn.train.Progress`."""

    title = "training"

    def __call__(self, progress: TrainProgress) -> None:
        """Show how far training is."""
        seconds = max(progress.seconds, 1e-9)
        rescues = progress.metrics["rescues_per_episode"] if progress.metrics else None
        parts = [
            "no episode yet" if rescues is None else f"{rescues:.2f} rescues/episode",
            f"{progress.env_steps / seconds:,.0f} env-steps/s",
            f"{progress.updates / seconds:,.1f} updates/s",
        ]
        self.show(progress.env_steps, progress.total_env_steps, " | ".join(parts))


class Evaluating(Work):
    """Shows evaluation; call it with the episodes done and the episodes to do."""

    title = "evaluating"

    def __call__(self, done: int, total: int) -> None:
        """Show how far evaluation is."""
        self.show(done, total, f"{done:,} of {total:,} episodes")
