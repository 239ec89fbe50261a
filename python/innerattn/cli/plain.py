"""What the command prints holds nothing that a terminal obeys, but what Rich draws for us."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import IO, Any, TextIO, cast

from rich.console import Console
from rich.segment import Segment
from rich.text import Text

from innerattn.errors import plain


class Escaping:
    """A text stream that writes everything as `plain` has it, except what Rich draws itself."""

    def __init__(self, stream: TextIO) -> None:
        """Write to ``stream``, and let Rich write there directly."""
        self._stream = stream
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Write."""
        self._stream.write(plain(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        """Everything else is that of the stream."""
        return getattr(self._stream, name)


class PlainConsole(Console):
    """Rich's console; of what it is given as text, nothing moves the cursor or sets a colour."""

    @property
    def file(self) -> IO[str]:
        """The stream below everything that escapes; a bar puts a proxy of its own on top."""
        file = super().file
        while (below := getattr(file, "rich_proxied_file", file)) is not file:
            file = below
        return file

    @file.setter
    def file(self, new_file: IO[str]) -> None:
        self._file = new_file

    def render(self, *args: Any, **named: Any) -> Iterable[Segment]:
        """See `rich.console.Console.render`; texts that came with a style are escaped here."""
        for one in super().render(*args, **named):
            yield one if one.control else Segment(plain(one.text), one.style)

    def render_str(self, text: str, *args: Any, **named: Any) -> Text:
        """See `rich.console.Console.render_str`; escaped before it is measured and wrapped."""
        return super().render_str(plain(text), *args, **named)


@contextmanager
def escaped_output() -> Iterator[None]:
    """Inside the block, what is printed is plain, whoever it came from."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, Escaping(stream)) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
