"""Output that cannot be written: it is dropped, or an error names the stream."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast


class Droppable:
    """A text stream that drops everything once something cannot be written to it."""

    def __init__(self, stream: TextIO) -> None:
        """Write to ``stream`` as long as that is possible."""
        self._stream = stream
        self.lost = False
        drawn = getattr(stream, "rich_proxied_file", None)
        self.rich_proxied_file: Droppable = self if drawn is None else Droppable(drawn)

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
            _drop_what_waits(self._stream)


class Named:
    """A text stream whose errors name it as a file's errors name the file."""

    def __init__(self, stream: TextIO, name: str) -> None:
        """Write to ``stream``, which is called ``name``."""
        self._stream, self._name = stream, name

    def write(self, text: str) -> int:
        """Write.

        Raises:
            OSError: it cannot be written.
        """
        with self._named():
            return self._stream.write(text)

    def flush(self) -> None:
        """Flush.

        Raises:
            OSError: it cannot be written.
        """
        with self._named():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        """Everything else is that of the stream."""
        return getattr(self._stream, name)

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            _drop_what_waits(self._stream)
            raise OSError(error.errno, error.strerror, self._name) from error


def _drop_what_waits(stream: TextIO) -> None:
    """Write to nowhere from now on: what is in the buffer would fail again as the process ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def fill_missing_streams() -> None:
    """Let what is written to a stream that was closed before the start be dropped.

    The numbers 0 to 2 are taken, too: a file that was opened under one of them would get what
    libraries print.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)  # the lowest free number: this one
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            stream = open(number, mode, encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)


@contextmanager
def named_output() -> Iterator[None]:
    """Inside the block, an error of the standard output names it; all is written at its end.

    Raises:
        OSError: something cannot be written.
    """
    before = sys.stdout
    sys.stdout = cast(TextIO, Named(before, "standard output"))
    try:
        try:
            yield
        except SystemExit:  # after help
            sys.stdout.flush()
            raise
        sys.stdout.flush()
    finally:
        sys.stdout = before


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
