"""Learning curves: rescues against env-steps and time, beside scripts; it measures nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from innerattn.report.plots.drawing import (
    BLUE,
    COLUMN_WIDTH_IN,
    GREEN,
    ORANGE,
    PAGE_WIDTH_IN,
    PURPLE,
    SKY,
    draw_level,
    labelled,
    legend_below,
)
from innerattn.stats.seeds import Array
from innerattn.studies.curves import LearningCurve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STYLES = ((BLUE, "-"), (ORANGE, "--"), (PURPLE, "-."), (GREEN, ":"), (SKY, "-"))


def draw_curves(lines: Sequence[LearningCurve]) -> Figure:
    """Panels for each situation, above against env-steps and below against time.

    Args:
        lines: at least one, of up to five methods; scripts of a panel's first line are drawn.
    """
    from matplotlib.figure import Figure

    situations = list(dict.fromkeys(line.situation for line in lines))
    methods = list(dict.fromkeys(line.method for line in lines))
    unit = " or ".join(dict.fromkeys(line.unit for line in lines))
    width = PAGE_WIDTH_IN if len(situations) > 1 else COLUMN_WIDTH_IN
    figure = Figure(figsize=(width, 4.8), layout="constrained")
    rows = figure.subplots(2, len(situations), squeeze=False, sharey="col")
    for (above, below), situation in zip(rows.T, situations, strict=True):
        own = [line for line in lines if line.situation == situation]
        for line in own:
            style = _STYLES[methods.index(line.method) % len(_STYLES)]
            _line(above, line.env_steps / 1000.0, line, *style)
            _line(below, line.seconds / 60.0, line, *style)
        above.set_title(situation, fontsize=9)
        above.set_xlabel("training [1,000 env-steps]", fontsize=8)
        below.set_xlabel("training [min]", fontsize=8)
        for panel in (above, below):
            for name, height in own[0].scripts.items():
                draw_level(panel, height, name, (0, (1, 1)))
            panel.tick_params(labelsize=7, length=2)
        above.set_ylim(0.0, 1.06 * above.get_ylim()[1])
    for panel in rows[:, 0]:
        panel.set_ylabel(f"rescues per {unit} of training", fontsize=8)
    legend_below(figure, labelled(rows[0, 0]))
    return figure


def _line(panel: Axes, times: Array, line: LearningCurve, colour: str, style: str) -> None:
    found = line.rescues
    panel.plot(times, found.mean, style, color=colour, linewidth=1.4, label=line.method)
    panel.fill_between(times, found.low, found.high, color=colour, alpha=0.2, linewidth=0.0)
