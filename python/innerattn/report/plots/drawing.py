"""What figures share: colours, sizes, panels, legends, and files that are the same every time."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from innerattn.config.files import write_whole
from innerattn.errors import RunError
from innerattn.experiments.run import OfMethod
from innerattn.stats.seeds import BAND_NAMES, SeedCurve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

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


Drawn = TypeVar("Drawn", bound=OfMethod)


def method_panels(
    found: Sequence[Drawn],
    margin_in: float,
    label: str,
    draw: Callable[[Axes, Drawn], Mapping[str, Any]],
) -> tuple[Figure, NDArray[np.object_], dict[str, Any]]:
    """A row of panels for each method and a column for each situation, of one scale.

    Args:
        found: at least one; the first of a situation and method is drawn.
        margin_in: height of all that is not panels [in].
        label: of the values.
        draw: draws into a panel, and gives what a legend shows of it.

    Returns:
        The figure, its panels by row and column, and what a legend shows.
    """
    from matplotlib.figure import Figure

    methods = list(dict.fromkeys(one.method for one in found))
    situations = list(dict.fromkeys(one.situation for one in found))
    width = PAGE_WIDTH_IN if len(situations) > 1 else COLUMN_WIDTH_IN
    figure = Figure(figsize=(width, margin_in + 2.3 * len(methods)), layout="constrained")
    panels = figure.subplots(len(methods), len(situations), sharey=True, squeeze=False)
    handles: dict[str, Any] = {}
    for row, method in zip(panels, methods, strict=True):
        for panel, situation in zip(row, situations, strict=True):
            own = [one for one in found if (one.method, one.situation) == (method, situation)]
            if own:
                handles |= draw(panel, own[0])
                panel.tick_params(labelsize=7, length=2)
            else:
                panel.set_axis_off()
        row[0].set_ylabel(label, fontsize=8)
    return figure, panels, handles


def legend_below(
    figure: FigureBase, handles: Mapping[str, Any], columns: int | None = None
) -> None:
    """A legend under all panels, in one row unless there are ``columns``."""
    figure.legend(
        handles.values(),
        handles.keys(),
        fontsize=7,
        ncols=columns or len(handles) or 1,
        loc="outside lower center",
        frameon=False,
    )


def labelled(panel: Axes) -> dict[str, Any]:
    """What a legend shows of a panel, by the labels in it."""
    handles, names = panel.get_legend_handles_labels()
    return dict(zip(names, handles, strict=True))


def draw_level(panel: Axes, height: float, name: str, style: Any, *, below: bool = False) -> None:
    """A line across a panel, named at the left, above it or ``below``."""
    panel.axhline(height, color=BLACK, linewidth=0.8, linestyle=style)
    panel.annotate(
        name,
        (0.02, height),
        xycoords=("axes fraction", "data"),
        xytext=(0, -1 if below else 1),
        textcoords="offset points",
        fontsize=6,
        va="top" if below else "bottom",
    )


def runs_and_band(runs: int, curve: SeedCurve) -> str:
    """How many runs a curve is over, and what its band is."""
    return "1 run" if runs == 1 else f"{runs} runs, band: {BAND_NAMES[curve.band]}"
