"""Interruptions are heard even where a library swallows them, as compiling does now and then."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def heard_interruptions() -> Iterator[Callable[[], None]]:
    """Remember every signal that raises KeyboardInterrupt.

    Only the main thread hears signals; elsewhere, and of signals that do something else, nothing
    is changed.

    Yields:
        What raises KeyboardInterrupt if there has been such a signal, to be called now and then.
    """
    asked = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        asked = True
        signal.default_int_handler(number, frame)

    def check() -> None:
        if asked:
            raise KeyboardInterrupt

    interrupting = []
    if threading.current_thread() is threading.main_thread():
        own = signal.default_int_handler
        interrupting = [one for one in signal.valid_signals() if signal.getsignal(one) is own]
    for one in interrupting:
        signal.signal(one, note)
    try:
        yield check
    finally:
        for one in interrupting:
            signal.signal(one, signal.default_int_handler)
