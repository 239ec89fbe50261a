"""Requests to end by a signal: Ctrl-C, SIGTERM and SIGHUP raise one exception, which names it."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType


class Interrupted(KeyboardInterrupt):
    """A signal asked this process to end.

    Attributes:
        number: of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


def exit_code(error: KeyboardInterrupt) -> int:
    """The exit code of a process that ends by an interruption: 128 and the signal's number."""
    return 128 + (error.number if isinstance(error, Interrupted) else signal.SIGINT)


def is_of_interruption(code: int) -> bool:
    """Whether an exit code is one of `exit_code`."""
    return code > 128


def end_at_once(code: int) -> None:
    """End the process; Python's own end frees every object one by one, long on a busy machine."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # a lost terminal, or none
            stream.flush()
    os._exit(code)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handle a signal.

    Raises:
        Interrupted: always.
    """
    del frame
    raise Interrupted(number)


def leave(number: int, frame: FrameType | None = None) -> None:
    """Handle a signal while nothing is there to be saved: say so in one line, and end at once.

    Modules that are being loaded could take an exception for something else.
    """
    del frame
    try:
        os.write(2, b"innerattn: interrupted\n")
    finally:
        os._exit(128 + number)


def handle_requests(handler: object) -> list[int]:
    """Let ``handler`` take the signals that ask for the end, where nothing else was set for them.

    Returns:
        The signals; none outside the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        return []
    taken = []
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        usual = (signal.SIG_DFL, signal.default_int_handler, interrupt, leave)
        if number is not None and signal.getsignal(number) in usual:
            signal.signal(number, handler)  # type: ignore[arg-type]
            taken.append(number)
    return taken


@contextmanager
def requests_handled_by(handler: object) -> Iterator[None]:
    """As `handle_requests`, inside the block."""
    names = ("SIGINT", "SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    taken = handle_requests(handler)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])
