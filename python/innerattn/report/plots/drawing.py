"""What all figures share: colours, sizes, and files that are the same every time."""

from __future__ import annotations

import io
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from innerattn.config.files import write_whole
from innerattn.errors import RunError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("pdf", "png", "svg")
"""Kinds of files that can be drawn, by their suffix."""

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    *("#000000", "#E69F00", "#56B4E9", "#009E73"),
    *("#F0E442", "#0072B2", "#D55E00", "#CC79A7"),
)
"""Okabe & Ito's palette, told apart with every common colour blindness."""

TWIN_DASHES = ("-", "--", ":", "-.")
"""Of lines of robots of one kind, which have one colour; beyond the last they repeat."""

COLUMN_WIDTH_IN, PAGE_WIDTH_IN = 3.4, 7.0
"""Widths of figures over one column of a page and over both [in]."""


def check_format(path: Path) -> str:
    """The format that a file's suffix names.

    Raises:
        RunError: it names none of `FORMATS`, or matplotlib is not installed.
    """
    kind = path.suffix.removeprefix(".").lower()
    if kind not in FORMATS:
        raise RunError(f"{path}: the file must end in {', '.join('.' + x for x in FORMATS)}")
    if find_spec("matplotlib") is None:
        raise RunError("drawing needs matplotlib: pip install 'innerattn[report]'")
    return kind


def write_figure(path: Path, figure: Figure) -> None:
    """Put a figure into a file, whole or not at all; equal figures give equal bytes.

    Raises:
        RunError: see `check_format`.
        OSError: the file cannot be written.
    """
    kind = check_format(path)
    from matplotlib import rc_context

    buffer = io.BytesIO()
    # Without dates and random names in it the same figures give the same bytes.
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    with rc_context({"svg.hashsalt": "innerattn"}):
        figure.savefig(buffer, format=kind, dpi=200, metadata=metadata)
    write_whole(path, buffer.getvalue())
