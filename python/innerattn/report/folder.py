"""The folder of a report: files of each kind, with a note where the study is a smoke run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from innerattn.config.files import write_whole
from innerattn.experiments.run import FinishedRun, named_from
from innerattn.experiments.smoke import smoke_note
from innerattn.report.plots.drawing import write_figure
from innerattn.report.smoke import mark_figure, noted_csv, noted_markdown

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


class ReportFolder:
    """Writes files into a folder, each whole or not at all."""

    def __init__(self, path: Path, budget: str) -> None:
        """Write into ``path``, which exists, what is made of runs of a built-in budget."""
        self.path = path
        self.budget = budget

    def json(self, name: str, document: Mapping[str, Any], *, note: bool = True) -> None:
        """Write a document of plain values; ``note``: it may have one more, of smoke runs."""
        noted = {**({"note": smoke_note(self.budget)} if note else {}), **document}
        write_whole(self.path / name, f"{json.dumps(noted, allow_nan=False)}\n".encode())

    def markdown(self, name: str, text: str, *, note: bool = True) -> None:
        """Write a page, with a note of smoke runs unless it has one."""
        noted = noted_markdown(text, self.budget) if note else text
        write_whole(self.path / name, noted.encode())

    def csv(self, name: str, text: str) -> None:
        """Write a table of values."""
        write_whole(self.path / name, noted_csv(text, self.budget).encode())

    def draw(self, name: str, figure: Figure | None) -> None:
        """Write a figure as .pdf and .png, or remove that of other runs where there is none."""
        if figure is not None:
            mark_figure(figure, self.budget)
        for suffix in (".pdf", ".png"):
            drawn = self.path / f"{name}{suffix}"
            if figure is None:
                drawn.unlink(missing_ok=True)
            else:
                write_figure(drawn, figure)
