"""Several runs side by side, a process each: started, heard, and stopped when all is to stop.

A process is asked to stop by closing its pipe, so it stops by itself too when its parent is gone.
It says how far it is with numbers from 0 to 1, and at last what it found or why it failed.
"""

from __future__ import annotations

import signal
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from multiprocessing import connection, get_context, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from innerattn.config import RunConfig
from innerattn.errors import needs_no_traceback, one_line

if TYPE_CHECKING:
    from innerattn.evaluate import Summary
    from innerattn.train import Progress

_SPAWN = get_context("spawn")
_FOR_THE_FIRST = {
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
}
"""Signals that only the first process minds; the others learn of the end from it."""
_CAN_BLOCK = hasattr(signal, "pthread_sigmask")
"""Whether a process can be started with signals blocked; on Windows it cannot."""
_TRAINING = 0.95
"""Part of a run that is training; the rest is evaluation."""
_REPORT_EVERY_S = 0.2


@dataclass
class Run:
    """One run, and how far it is.

    Attributes:
        config: what is trained.
        folder: where.
        trained: it is trained already, and only measured.
        state: what it is doing.
        share: part that is done, 0 to 1.
        summary: what its evaluation found, once it is done.
        failure: why it failed, in one line, if it did.
    """

    config: RunConfig
    folder: Path
    trained: bool = False
    state: Literal["waiting", "running", "done", "failed"] = "waiting"
    share: float = 0.0
    summary: Summary | None = None
    failure: str | None = None

    @property
    def size(self) -> float:
        """How much there is to do, in whole runs."""
        return 1.0 - _TRAINING if self.trained else 1.0


def refuse_what_cannot_run(runs: Sequence[Run]) -> None:
    """Find out in time what every run would fail of.

    Raises:
        RunError: the folder of a run that is to be trained exists.
        ConfigError: the configuration cannot be run here.
    """
    from innerattn.envs import BatchEnv
    from innerattn.train.build import build_learner
    from innerattn.train.checkpoint import refuse_existing

    for run in runs:
        if not run.trained:
            refuse_existing(run.folder)
    config = runs[0].config
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        build_learner(config, env)


def train_side_by_side(
    runs: Sequence[Run],
    at_once: int,
    *,
    changed: Callable[[Sequence[Run]], None],
    failed: Callable[[Run], None],
    debug: bool = False,
    keep: object = None,
) -> None:
    """Train and evaluate every run in a process of its own; a failure leaves the others alone.

    Args:
        runs: the runs, all waiting; they are kept up to date.
        at_once: processes at a time, at least 1.
        changed: called with all runs when one of them is further.
        failed: called with each run that failed.
        debug: let a process that fails show where.
        keep: handed to every process, which keeps it until its end.

    Raises:
        KeyboardInterrupt: after every process has saved what it learnt and is gone; a second one
            ends them at once.
    """
    waiting = deque(runs)
    running: dict[Connection, tuple[Run, BaseProcess]] = {}
    if _CAN_BLOCK:
        resource_tracker.ensure_running()  # would else unblock signals in the middle of a start
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                _start(waiting.popleft(), running, debug, keep)
            for pipe in connection.wait(list(running)):
                pipe = cast(Connection, pipe)
                run, process = running[pipe]
                _hear(run, pipe, process)
                if run.state != "running":
                    del running[pipe]
                    pipe.close()
                    process.join()
                if run.state == "failed":
                    failed(run)
            changed(runs)
    finally:
        _stop(running)


def _start(
    run: Run, running: dict[Connection, tuple[Run, BaseProcess]], debug: bool, keep: object
) -> None:
    """Start a process that Ctrl-C does not reach: what a terminal sends, it sends to all."""
    before = set()
    if _CAN_BLOCK:  # what is blocked is handed down to the process
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _FOR_THE_FIRST)
    try:
        pipe, its_end = _SPAWN.Pipe()
        arguments = (run.config, run.folder, its_end, debug, keep, run.trained)
        process = _SPAWN.Process(target=work, args=arguments, daemon=True)
        process.start()
        its_end.close()
        run.state = "running"
        running[pipe] = (run, process)
    finally:
        if _CAN_BLOCK:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _hear(run: Run, pipe: Connection, process: BaseProcess) -> None:
    """Take one message of a run; its end without a word is one too."""
    try:
        message: float | str | Summary = pipe.recv()
    except (EOFError, OSError):
        process.join()
        code = process.exitcode or 0
        message = f"its process ended with {f'signal {-code}' if code < 0 else f'code {code}'}"
    if isinstance(message, float):
        run.share = message
    elif isinstance(message, str):
        run.state, run.failure = "failed", message
    else:
        run.state, run.share, run.summary = "done", 1.0, message


def _stop(running: dict[Connection, tuple[Run, BaseProcess]]) -> None:
    """Ask all processes to stop and wait until they are gone."""
    processes = [process for _, process in running.values()]
    for pipe in running:
        pipe.close()
    try:
        for process in processes:
            process.join()
    except KeyboardInterrupt:
        for process in processes:
            process.kill()
            process.join()
        raise


def work(
    config: RunConfig,
    folder: Path,
    pipe: Connection,
    debug: bool,
    keep: object = None,
    trained: bool = False,
) -> None:
    """What the process of a run does: the same as `innerattn train` for one seed.

    Args:
        config: what is trained.
        folder: where.
        pipe: takes shares, and at last a summary or the reason of a failure; its end ends the run.
        debug: let an error that is told through the pipe be seen too.
        keep: what comes with the process and lasts as long by itself, such as a lock.
        trained: measure it only.
    """
    del keep  # it lasts without this name
    if not _CAN_BLOCK:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    report = _Report(pipe)
    try:
        from innerattn.evaluate import evaluate_run
        from innerattn.train import train

        report.show(0.0)  # ends here if all was stopped while torch was loaded
        before = 0.0 if trained else _TRAINING
        if not trained:
            train(config, folder, progress=lambda p: report(before * trained_share(config, p)))
        evaluation = evaluate_run(
            folder, progress=lambda done, total: report(before + done / total * (1.0 - before))
        )
        evaluation.write(folder / "evaluation")
        pipe.send(evaluation.summary)
    except KeyboardInterrupt:
        return
    except Exception as error:
        told = needs_no_traceback(error)
        if told:
            with suppress(BrokenPipeError):  # nobody listens any more
                pipe.send(one_line(error))
        if debug or not told:
            raise


def trained_share(config: RunConfig, progress: Progress) -> float:
    """Part of the env-steps of a run that is done, imitation and learning from rewards together."""
    before = config.imitation.env_steps if config.train.warm_start != "none" else 0
    done = progress.env_steps + (before if progress.stage == "training" else 0)
    return done / (before + config.train.env_steps)


class _Report:
    """Says now and then how far a run is, and interrupts it when nobody listens any more."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._last = time.monotonic()

    def __call__(self, share: float) -> None:
        now = time.monotonic()
        if now - self._last >= _REPORT_EVERY_S:
            self._last = now
            self.show(share)

    def show(self, share: float) -> None:
        try:
            if not self._pipe.poll():  # nothing is ever sent here: there is only the end to hear
                self._pipe.send(min(share, 1.0))
                return
        except OSError:
            pass
        raise KeyboardInterrupt
