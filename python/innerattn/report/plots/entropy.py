"""Fig. 4: the entropy of attention during training; it measures nothing.

A panel has one band, of the mean over robots and heads, one line for each robot, and at its right
edge a dot for each head at the end of training.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from innerattn.envs.colours import robot_looks
from innerattn.experiments.paper.fig4 import EntropyCourse
from innerattn.report.plots.drawing import (
    BLACK,
    TWIN_DASHES,
    draw_level,
    legend_below,
    method_panels,
    runs_and_band,
)
from innerattn.stats.seeds import Array

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_GREY = "#C8C8C8"
_HEADS = 0.24  # width of the strip of heads, in lengths of the training


def draw_entropy(courses: Sequence[EntropyCourse], printed_nats: float) -> Figure:
    """A row for each method and a column for each situation.

    Args:
        courses: at least one.
        printed_nats: the paper's value, drawn for comparison.
    """

    def draw(panel: Axes, course: EntropyCourse) -> dict[str, Artist]:
        handles = _course(panel, course)
        _heads(panel, course)
        draw_level(panel, course.even_nats, f"uniform {course.even_nats:.2f}", "-")
        draw_level(panel, printed_nats, f"paper {printed_nats:.2f}", ":", below=True)
        runs = runs_and_band(len(course.seeds), course.mean())
        panel.set_title(f"{course.situation}, {course.method}\n{runs}", fontsize=7)
        panel.set_xlabel("training [1,000 env-steps]", fontsize=7)
        return handles

    figure, panels, handles = method_panels(courses, 0.5, "entropy of attention [nats]", draw)
    for row in panels:
        for panel in row:
            if panel.axison:
                _teammates(panel, labelled=panel is row[-1])
    wide = len({course.situation for course in courses}) > 1
    legend_below(figure, handles, None if wide else 2)
    drawn = [
        values
        for one in courses
        for values in (one.mean().mean, one.by_robot().mean, one.end_by_head())
    ]
    least = min(printed_nats, *(float(x.min()) for x in drawn if x.size))
    most = 1.06 * max(course.even_nats for course in courses)
    panels[0, 0].set_ylim(max(0.0, least - 0.05), most)
    return figure


def _course(panel: Axes, course: EntropyCourse) -> dict[str, Artist]:
    """Draw the courses; what a legend shows."""
    handles: dict[str, Artist] = {}
    steps, mean = course.env_steps / 1000.0, course.mean()
    if np.isfinite(mean.low).any():
        panel.fill_between(steps, mean.low, mean.high, color=_GREY, linewidth=0.0)
    looks, by_robot = robot_looks(course.kinds), course.by_robot().mean
    for robot, look, nats in zip(course.robots, looks, by_robot.T, strict=True):
        dash = TWIN_DASHES[look.twin % len(TWIN_DASHES)]
        (handles[robot],) = panel.plot(steps, nats, dash, color=look.colour, linewidth=0.8)
    (handles["mean over robots"],) = panel.plot(steps, mean.mean, color=BLACK, linewidth=1.3)
    return handles


def _heads(panel: Axes, course: EntropyCourse) -> None:
    """A strip beside the courses: the heads of each robot in a column of their own."""
    from matplotlib.ticker import MaxNLocator

    last = float(course.env_steps[-1]) / 1000.0
    strip = _HEADS * last
    places = last + strip * (np.arange(len(course.robots)) + 1.0) / (len(course.robots) + 0.5)
    for r, (place, look) in enumerate(zip(places, robot_looks(course.kinds), strict=True)):
        values = course.end_by_head()[:, r].ravel()
        panel.plot(
            np.full(len(values), place),
            values,
            "o",
            color=look.colour,
            markersize=2.2,
            markeredgewidth=0.0,
            alpha=0.6,
        )
    panel.axvline(last + 0.03 * strip, color=_GREY, linewidth=0.7)
    panel.annotate(
        "heads",
        (last + 0.55 * strip, 0.02),
        xycoords=("data", "axes fraction"),
        fontsize=6,
        ha="center",
    )
    ticks = MaxNLocator(nbins=4, steps=[1, 2, 5, 10]).tick_values(0.0, last)
    panel.set_xticks([tick for tick in ticks if 0.0 <= tick <= 1.001 * last])
    panel.set_xlim(-0.03 * last, last + 1.08 * strip)


def _teammates(panel: Axes, *, labelled: bool) -> None:
    """An axis on the right: exp(entropy), how many teammates are attended to in effect."""
    from matplotlib.ticker import MaxNLocator

    axis = panel.secondary_yaxis("right", functions=(_exp, _log))
    axis.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    axis.tick_params(labelsize=7 if labelled else 0, length=2, labelright=labelled)
    if labelled:
        axis.set_ylabel("exp(entropy) [teammates]", fontsize=8)


def _exp(values: ArrayLike) -> Array:
    return np.exp(np.asarray(values, np.float64))


def _log(values: ArrayLike) -> Array:
    return np.log(np.maximum(np.asarray(values, np.float64), 1e-9))
