"""A heat map of retention under faults: a panel for each robot and onset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from innerattn.evaluate.faults.grid import ONSETS, Grid, Retention
from innerattn.report.plots.drawing import check_format, write_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_INK_CHANGES_AT = 0.45  # dark ink on light cells and light ink on dark ones


def draw_heatmap(name: str, retention: Retention, grid: Grid) -> Figure:
    """Retention by kind (rows) and severity (columns), a panel for each robot and onset.

    Args:
        name: what the policy is called.
        retention: what is drawn.
        grid: the faults.
    """
    from matplotlib.figure import Figure

    robots = [robot.name for robot in grid.scenario.robots]
    size = (1.6 + 1.5 * len(robots), 1.0 + 0.62 * len(grid.kinds))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(ONSETS), len(robots), sharex=True, sharey=True, squeeze=False)
    image: Any = None
    for o, onset in enumerate(ONSETS):
        for r, robot in enumerate(robots):
            panel, values = panels[o, r], retention.cells.value[:, :, r, o]
            image = panel.imshow(values, cmap="cividis", vmin=0.0, vmax=1.0, aspect="auto")
            for (k, s), value in np.ndenumerate(values):
                ink = "white" if value < _INK_CHANGES_AT else "black"
                panel.text(s, k, f"{value:.2f}", ha="center", va="center", color=ink, fontsize=6)
            panel.set_xticks(range(len(grid.severities)), [f"{x:g}" for x in grid.severities])
            labels = [kind.replace("_", " ") for kind in grid.kinds]
            panel.set_yticks(range(len(grid.kinds)), labels)
            panel.tick_params(labelsize=7, length=2)
            if o == 0:
                panel.set_title(robot, fontsize=8)
        when = "from the start" if onset == "start" else f"from step {grid.middle}"
        panels[o, 0].set_ylabel(when, fontsize=8)
    figure.supxlabel("severity of the fault of this robot", fontsize=8)
    figure.suptitle(f"Retention of {name}", fontsize=9)
    bar = figure.colorbar(image, ax=panels, shrink=0.6, extend="max")
    bar.set_label("rescues with the fault / without it", fontsize=7)
    bar.ax.tick_params(labelsize=7)
    return figure


def write_heatmap(path: Path, name: str, retention: Retention, grid: Grid) -> None:
    """Draw a heat map into a file, whole or not at all.

    Raises:
        RunError: see `drawing.check_format`.
        OSError: the file cannot be written.
    """
    check_format(path)
    write_figure(path, draw_heatmap(name, retention, grid))
