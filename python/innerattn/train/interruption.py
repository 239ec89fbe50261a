"""Interruptions of training: they wait for a moment at which everything can be saved.

Libraries may swallow KeyboardInterrupt, as the compiler does; what was asked for is remembered.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import torch

from innerattn.learn import workers
from innerattn.signals import Interrupted, exit_code, interrupt

_OURS = (signal.default_int_handler, interrupt)


class Interruptions:
    """Signals that ask training to end; its contract is `innerattn.learn.interruptions`.

    Inside `deferred` the first one waits for `check`. The second one raises at once, wherever it
    arrives, and the third one ends the process.
    """

    def __init__(self) -> None:
        """Nobody has asked yet."""
        self._asked: list[int] = []
        self._deferred = False

    @property
    def urgent(self) -> bool:
        """Whether somebody asked twice, and does not want to wait for anything to be saved."""
        return len(self._asked) > 1

    def check(self) -> None:
        """Raise if there was a request; to be called regularly.

        Raises:
            Interrupted: there was one.
        """
        self.raise_if_asked()

    def take(self, error: KeyboardInterrupt) -> None:
        """Take over a request that was raised outside of training.

        Raises:
            KeyboardInterrupt: it is to be heard at once.
        """
        raise error

    def raise_if_asked(self) -> None:
        """Raise if there was a request that no `check` has found.

        Raises:
            Interrupted: there was one.
        """
        if self._asked:
            raise Interrupted(self._asked[-1])

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Let the first request wait inside the block for `check`."""
        with self._deferring(True):
            yield

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Let a request raise at any moment inside the block."""
        with self._deferring(False):
            self.check()
            yield

    @contextmanager
    def _deferring(self, deferred: bool) -> Iterator[None]:
        before, self._deferred = self._deferred, deferred
        try:
            yield
        finally:
            self._deferred = before

    def note(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        del frame
        self._asked.append(number)
        if len(self._asked) > 2:
            os._exit(exit_code(Interrupted(number)))
        if self.urgent or not self._deferred:
            raise Interrupted(number)


class CommonInterruptions(Interruptions):
    """Requests to several workers, of which all learn at the same call of `check`.

    The first request always waits, also for the compiler: what all workers have is saved together.
    """

    def __init__(self, every: int) -> None:
        """Nobody has asked yet; ``every`` as of `remembered_interruptions`."""
        super().__init__()
        self._deferred = True
        self._every, self._calls = every, 0

    def check(self) -> None:
        """Raise if there was a request to any worker; all of them call this equally often.

        Raises:
            Interrupted: there was one.
        """
        self._calls += 1
        if self._calls % self._every == 0:
            newest = self._asked[-1] if self._asked else 0
            asked = int(workers.largest(torch.tensor(newest)))
            if asked:
                raise Interrupted(asked)

    def take(self, error: KeyboardInterrupt) -> None:
        """Take over a request, which waits for `check`."""
        self._asked.append(error.number if isinstance(error, Interrupted) else signal.SIGINT)

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Let a request wait here, too."""
        yield


@contextmanager
def remembered_interruptions(every: int = 8) -> Iterator[Interruptions]:
    """Remember every signal that raises KeyboardInterrupt.

    Signals with other handlers are not changed, nor is anything outside the main thread.

    Args:
        every: calls of `Interruptions.check` between two exchanges of several workers, each of
            which takes some time.

    Yields:
        What tells whether there has been such a signal.
    """
    interruptions = Interruptions() if workers.count() == 1 else CommonInterruptions(every)
    before = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {one: signal.getsignal(one) for one in signal.valid_signals()}
        before = {one: handler for one, handler in handlers.items() if handler in _OURS}
    for one in before:
        signal.signal(one, interruptions.note)
    try:
        yield interruptions
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
