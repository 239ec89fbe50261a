"""The folder of a report: files of each kind, with a note where the study is a smoke run."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from innerattn.config.files import write_whole
from innerattn.experiments.run import FinishedRun, named_from
from innerattn.experiments.smoke import smoke_note
from innerattn.report.plots.drawing import write_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def listed_runs(runs: Sequence[FinishedRun], out: Path) -> list[dict[str, Any]]:
    """What names each run in a document, its folder from ``out``."""
    return [
        {
            "situation": run.situation,
            "trained": run.case.trained,
            "seed": run.seed,
            "folder": named_from(run.folder, out),
            "config_sha256": run.config_sha256,
            "weights_sha256": run.weights_sha256,
        }
        for run in runs
    ]


def left_out_list(left_out: Sequence[str]) -> list[str]:
    """What a page says of what is missing, as paragraphs; none where nothing is."""
    return ["**Left out of all results:**\n", *map("- {}".format, left_out), ""] if left_out else []


class ReportFolder:
    """Writes files into a folder, each whole or not at all.

    Where runs are too short for any number to mean something, every file says so.
    """

    def __init__(self, path: Path, budget: str) -> None:
        """Write into ``path``, which exists, what is made of runs of a built-in budget."""
        self.path = path
        self.budget = budget
        self._note = smoke_note(budget)

    def json(self, name: str, document: Mapping[str, Any], *, note: bool = True) -> None:
        """Write a document of plain values; ``note``: it may have one more, of smoke runs."""
        noted = {**({"note": self._note} if note else {}), **document}
        write_whole(self.path / name, f"{json.dumps(noted, allow_nan=False)}\n".encode())

    def markdown(self, name: str, text: str, *, note: bool = True) -> None:
        """Write a page; a note of smoke runs stands at its top, unless it has one."""
        if note and self._note:
            text = f"> **{self._note[:1].upper()}{self._note[1:]}.**\n\n{text}"
        write_whole(self.path / name, text.encode())

    def csv(self, name: str, text: str) -> None:
        """Write a table of values; a note of smoke runs is a last column on every line."""
        if self._note:
            rows, noted = csv.reader(io.StringIO(text)), io.StringIO()
            writer = csv.writer(noted, lineterminator="\n")
            writer.writerows([*row, self._note if i else "note"] for i, row in enumerate(rows))
            text = noted.getvalue()
        write_whole(self.path / name, text.encode())

    def draw(self, name: str, figure: Figure | None) -> None:
        """Write a figure as .pdf and .png, or remove that of other runs where there is none.

        What is made of smoke runs says so across the figure.
        """
        if figure is not None and self._note:
            words = f"budget {self.budget}:\na smoke run,\nno result"
            look: dict[str, Any] = {"ha": "center", "va": "center", "rotation": 30, "alpha": 0.2}
            figure.text(0.5, 0.5, words, fontsize=28, zorder=10, **look)
        for suffix in (".pdf", ".png"):
            drawn = self.path / f"{name}{suffix}"
            if figure is None:
                drawn.unlink(missing_ok=True)
            else:
                write_figure(drawn, figure)
