"""Several jobs side by side, a process each: started, heard, and stopped when all is to stop.

A process is asked to stop by closing its pipe, so it stops by itself too when its parent is gone.
It says how far it is with numbers from 0 to 1, and at last what it found or why it failed.
"""

from __future__ import annotations

import math
import signal
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import connection, get_context, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Literal, TypeVar, cast

from innerattn.cores import usable_cores
from innerattn.errors import needs_no_traceback, one_line

_SPAWN = get_context("spawn")
_FOR_THE_FIRST = {
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
}
"""Signals that only the first process minds; the others learn of the end from it."""
_CAN_BLOCK = hasattr(signal, "pthread_sigmask")
"""Whether a process can be started with signals blocked; on Windows it cannot."""
_REPORT_EVERY_S = 0.2


@dataclass(kw_only=True)
class Job(ABC):
    """Work for a process, and how far it is. It must be picklable.

    Attributes:
        state: what it is doing.
        share: part that is done, 0 to 1.
        result: what `do` returned, once it is done.
        failure: why it failed, in one line, if it did.
    """

    state: Literal["waiting", "running", "done", "failed"] = "waiting"
    share: float = 0.0
    result: Any = None
    failure: str | None = None

    @property
    def size(self) -> float:
        """How much there is to do, beside a job of size 1."""
        return 1.0

    @abstractmethod
    def do(self, report: Callable[[float], None]) -> object:
        """Do the work; called in a process of its own.

        Args:
            report: to be called with the part that is done, first with 0 once all modules are
                loaded; it ends the job by a `KeyboardInterrupt` when all is to stop.

        Returns:
            The result, which must be picklable.
        """


AnyJob = TypeVar("AnyJob", bound=Job)


def places(jobs: int) -> int:
    """How many of ``jobs`` jobs, of one thread each, go at a time; at least 1."""
    return max(1, min(usable_cores(), jobs))


def run_side_by_side(
    jobs: Sequence[AnyJob],
    at_once: int,
    *,
    changed: Callable[[Sequence[AnyJob]], None],
    failed: Callable[[AnyJob], None],
    debug: bool = False,
) -> None:
    """Do every job in a process of its own; a failure leaves the others alone.

    Args:
        jobs: all waiting; they are kept up to date.
        at_once: processes at a time, at least 1.
        changed: called with all jobs when one of them is further.
        failed: called with each job that failed.
        debug: let a process that fails show where.

    Raises:
        KeyboardInterrupt: after every process has ended its job and is gone; a second one ends
            them at once.
    """
    waiting = deque(jobs)
    running: dict[Connection, tuple[AnyJob, BaseProcess]] = {}
    if _CAN_BLOCK:
        resource_tracker.ensure_running()  # would else unblock signals in the middle of a start
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                _start(waiting.popleft(), running, debug)
            for pipe in connection.wait(list(running)):
                pipe = cast(Connection, pipe)
                job, process = running[pipe]
                _hear(job, pipe, process)
                if job.state != "running":
                    del running[pipe]
                    pipe.close()
                    process.join()
                if job.state == "failed":
                    failed(job)
            changed(jobs)
    finally:
        _stop([process for _, process in running.values()], list(running))


def _start(
    job: AnyJob,
    running: dict[Connection, tuple[AnyJob, BaseProcess]],
    debug: bool,
) -> None:
    """Start a process that Ctrl-C does not reach: what a terminal sends, it sends to all."""
    before = set()
    if _CAN_BLOCK:  # what is blocked is handed down to the process
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _FOR_THE_FIRST)
    try:
        pipe, its_end = _SPAWN.Pipe()
        process = _SPAWN.Process(target=work, args=(job, its_end, debug), daemon=True)
        process.start()
        its_end.close()
        job.state = "running"
        running[pipe] = (job, process)
    finally:
        if _CAN_BLOCK:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _hear(job: Job, pipe: Connection, process: BaseProcess) -> None:
    """Take one message of a job; its end without a word is one too."""
    try:
        state, value = pipe.recv()
    except (EOFError, OSError):
        process.join()
        code = process.exitcode or 0
        ended = f"signal {-code}" if code < 0 else f"code {code}"
        state, value = "failed", f"its process ended with {ended}"
    job.state = state
    if state == "running":
        job.share = value
    elif state == "failed":
        job.failure = value
    else:
        job.share, job.result = 1.0, value


def _stop(processes: Sequence[BaseProcess], pipes: Sequence[Connection]) -> None:
    """Ask all processes to stop and wait until they are gone."""
    for pipe in pipes:
        pipe.close()
    try:
        for process in processes:
            process.join()
    except KeyboardInterrupt:
        for process in processes:
            process.kill()
            process.join()
        raise


def work(job: Job, pipe: Connection, debug: bool) -> None:
    """What the process of a job does.

    Args:
        job: what is to be done.
        pipe: takes pairs of a state and its value: the share of a running job, the result of one
            that is done, the reason of a failure; its end ends the job.
        debug: let an error that is told through the pipe be seen too.
    """
    if not _CAN_BLOCK:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        pipe.send(("done", job.do(_Report(pipe))))
    except KeyboardInterrupt:
        return
    except Exception as error:
        told = needs_no_traceback(error)
        if told:
            with suppress(BrokenPipeError):  # nobody listens any more
                pipe.send(("failed", one_line(error)))
        if debug or not told:
            raise


class _Report:
    """Says now and then how far a job is, and interrupts it when nobody listens any more."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._last = -math.inf

    def __call__(self, share: float) -> None:
        now = time.monotonic()
        if now - self._last < _REPORT_EVERY_S:
            return
        self._last = now
        try:
            if not self._pipe.poll():  # nothing is ever sent here: there is only the end to hear
                self._pipe.send(("running", min(share, 1.0)))
                return
        except OSError:
            pass
        raise KeyboardInterrupt
