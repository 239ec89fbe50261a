"""Output that nobody may read any more: what cannot be written is dropped, and the work goes on."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO


class Droppable:
    """A text stream that drops everything once something cannot be written to it."""

    def __init__(self, stream: TextIO) -> None:
        """Write to ``stream`` as long as that is possible."""
        self._stream = stream
        self.lost = False

    def write(self, text: str) -> int:
        """Write, or drop."""
        if not self.lost:
            self._try(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush, or forget about it."""
        if not self.lost:
            self._try(self._stream.flush)

    def __getattr__(self, name: str) -> Any:
        """Everything else is that of the stream."""
        return getattr(self._stream, name)

    def _try(self, write: Any) -> None:
        try:
            write()
        except OSError:  # the reader has left, the terminal is gone, or the disk is full
            self.lost = True
            # What waits in the stream's buffer would fail again at the end of the process.
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())


@contextmanager
def droppable_output() -> Iterator[None]:
    """Let nothing inside the block fail because its output cannot be written."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = Droppable(before[0]), Droppable(before[1])
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before
