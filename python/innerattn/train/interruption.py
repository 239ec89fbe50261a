"""Remembers interruptions, since libraries may swallow KeyboardInterrupt, as the compiler does."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def remembered_interruptions() -> Iterator[Callable[[], None]]:
    """Remember every signal that raises KeyboardInterrupt.

    Signals with other handlers are not changed, nor is anything outside the main thread.

    Yields:
        A function that raises KeyboardInterrupt if there has been such a signal; to be called
        regularly.
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
