"""A worker: claims runs of a study, trains and measures them, until none is left to do."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from innerattn.errors import needs_no_traceback, one_line
from innerattn.experiments.side_by_side import Run
from innerattn.studies.ledger import Claim, ClaimLostError, Ledger
from innerattn.studies.plan import PlannedRun

BEAT_EVERY_S = 10.0
"""How often a worker says that it is at work; a sixth of what makes others take its run over."""
_LOOK_EVERY_S = 2.0


@dataclass(frozen=True)
class Outcome:
    """What became of one claim of a run.

    Attributes:
        run: which run the worker had claimed.
        state: done; failed; given back, because the worker's time was up; or lost to another
            worker, which has it now.
        reason: why, if it failed.
    """

    run: PlannedRun
    state: str
    reason: str = ""


def work(
    ledger: Ledger,
    planned: Iterable[PlannedRun],
    *,
    until: float | None = None,
    wait: bool = True,
    report: Callable[[float], None] = lambda _: None,
    ended: Callable[[Outcome], None] = lambda _: None,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Work through a study beside any other workers, until nothing is left to do.

    A run that fails is noted in the ledger and stops no other. A run that a worker left is gone on
    with from its newest checkpoint.

    Args:
        ledger: of the study.
        planned: its runs in the order in which they are to be done; iterated before each claim, so
            that a search can ask for others.
        until: when to stop, as ``clock`` has it; the run at hand is saved and given back.
        wait: whether to stay while others work on the last runs, in case they fall silent.
        report: called with the part of the run at hand that is done, and with 0 while there is
            none; a `KeyboardInterrupt` of it asks the worker to end.
        ended: called with what became of it.
        clock: seconds.

    Raises:
        OSError: the ledger cannot be read or written.
        KeyboardInterrupt: the worker was asked to end; the run at hand is saved and given back.
    """
    while until is None or clock() < until:
        by_key = {run.key: run for run in planned}
        claim = ledger.claim(by_key)
        if claim is not None:
            ended(_worked(claim, by_key[claim.key], until, report, clock))
            continue
        states = ledger.states(by_key).values()
        if not wait or "claimed" not in states:
            return
        report(0.0)
        time.sleep(_LOOK_EVERY_S)


def _worked(
    claim: Claim,
    run: PlannedRun,
    until: float | None,
    report: Callable[[float], None],
    clock: Callable[[], float],
) -> Outcome:
    """Train and measure one run."""
    times_up = False
    with _beating(claim) as lost:

        def go_on(share: float) -> None:
            nonlocal times_up
            times_up = until is not None and clock() >= until
            if times_up or lost.is_set():
                raise KeyboardInterrupt  # as a user's: training saves what it has
            report(share)

        try:
            Run(run.config, claim.folder, begun=claim.folder.exists()).do(go_on)
            claim.finish()
        except ClaimLostError:
            return Outcome(run, "lost")
        except KeyboardInterrupt:
            if lost.is_set():
                return Outcome(run, "lost")
            claim.free()
            if times_up:
                return Outcome(run, "given back")
            raise
        except Exception as error:
            known = needs_no_traceback(error)
            reason = one_line(error) if known else traceback.format_exc()
            claim.fail(reason)
            return Outcome(run, "failed", one_line(error))
    return Outcome(run, "done")


@contextmanager
def _beating(claim: Claim) -> Iterator[threading.Event]:
    """Beat beside the work; the event says that the claim is another worker's by now."""
    lost, over = threading.Event(), threading.Event()

    def beat() -> None:
        while not over.wait(BEAT_EVERY_S):
            try:
                claim.beat()
            except ClaimLostError:
                lost.set()
                return
            except OSError:  # a full disk, or a file system that does not answer: try again
                continue

    thread = threading.Thread(target=beat, name="beat", daemon=True)
    thread.start()
    try:
        yield lost
    finally:
        over.set()
        with suppress(RuntimeError):
            thread.join()
