"""How outputs of a smoke run say so: its runs are too short for any number to mean something.

Each function takes the name of the built-in budget, and changes nothing of any budget but quick.
"""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from innerattn.experiments.smoke import smoke_note

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def noted_markdown(text: str, budget: str) -> str:
    """A text with the note at its top."""
    note = smoke_note(budget)
    return f"> **{note[:1].upper()}{note[1:]}.**\n\n{text}" if note else text


def noted_csv(text: str, budget: str) -> str:
    """A table with the note in a last column of its own, on every line."""
    note = smoke_note(budget)
    if note is None:
        return text
    noted = io.StringIO()
    rows = list(csv.reader(io.StringIO(text)))
    writer = csv.writer(noted, lineterminator="\n")
    writer.writerows([*row, note if index else "note"] for index, row in enumerate(rows))
    return noted.getvalue()


def mark_figure(figure: Figure, budget: str) -> Figure:
    """The figure itself, with the note's gist across it."""
    if smoke_note(budget):
        words = f"budget {budget}:\na smoke run,\nno result"
        figure.text(
            0.5,
            0.5,
            words,
            ha="center",
            va="center",
            rotation=30,
            fontsize=28,
            alpha=0.2,
            zorder=10,
        )
    return figure
