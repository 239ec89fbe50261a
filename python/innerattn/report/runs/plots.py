"""Interactive plots of the page about runs, as data for plotly.js. They compute nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from innerattn.experiments.learning.curves import LearningCurve
from innerattn.experiments.paper.fig4 import EntropyCourse
from innerattn.experiments.paper.fig5 import Evidence
from innerattn.stats.seeds import BAND_NAMES, SeedCurve

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's, told apart with every common colour blindness."""

_DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")


@dataclass(frozen=True)
class Plot:
    """A plot.

    Attributes:
        title: what it shows.
        note: what its lines and bands are.
        traces: for plotly.js.
        x: title of the horizontal axis.
        y: title of the vertical axis.
        levels: dashed horizontal lines by name.
    """

    title: str
    note: str
    traces: list[dict[str, Any]]
    x: str
    y: str
    levels: dict[str, float]

    def to_json(self) -> dict[str, Any]:
        """What the page's script draws."""
        axes = {"x": self.x, "y": self.y}
        return {"title": self.title, "traces": self.traces, **axes, "levels": self.levels}


def curves_plot(curves: Sequence[LearningCurve]) -> Plot:
    """Rescues per training episode against env-steps."""
    traces = []
    for index, curve in enumerate(curves):
        name = _label(curve)
        traces += _banded(name, curve.env_steps.tolist(), curve.rescues, index)
    first = curves[0]
    return Plot(
        title="Rescues per training episode",
        note=f"{_bands([curve.rescues for curve in curves])} Dashed: scripts in the worlds of the "
        f"first run's evaluation, situation {first.situation}.",
        traces=traces,
        x="env-steps",
        y="rescues per episode",
        levels=dict(first.scripts),
    )


def entropy_plot(courses: Sequence[EntropyCourse]) -> Plot:
    """Attention entropy of each robot against env-steps."""
    traces = []
    for which, course in enumerate(courses):
        by_robot, times = course.by_robot(), course.env_steps.tolist()
        for index, robot in enumerate(course.robots):
            name = robot if len(courses) == 1 else f"{robot}, {_label(course)}"
            line = {"color": COLOURS[index % len(COLOURS)], "dash": _DASHES[which % len(_DASHES)]}
            traces.append(_line(name, times, by_robot.mean[:, index].tolist(), line))
    evens = {f"even, ln {len(one.robots) - 1}": one.even_nats for one in courses}
    return Plot(
        title="Attention entropy",
        note="Mean over heads, and over runs. Less is more selective; even attention is dashed.",
        traces=traces,
        x="env-steps",
        y="entropy [nats]",
        levels=evens,
    )


def handoff_plot(found: Sequence[Evidence]) -> Plot:
    """The weights that robots give to their partners around handoffs."""
    traces = []
    words = {"before": "partner of the first rescue", "to_be": "partner of the second rescue"}
    for which, part in enumerate(found):
        times = (part.offsets * part.step_s).tolist()
        name = "" if len(found) == 1 else f"{_label(part)}: "
        for index, (role, word) in enumerate(words.items()):
            weight = part.robot[role].weight
            traces += _banded(f"{name}{word}", times, weight, index, _DASHES[which % 2])
            line = {"color": COLOURS[index], "dash": "dot", "width": 1.5}
            control = part.control[role].weight.mean.tolist()
            traces.append(_line(f"{name}bystander, {word}", times, control, line))
    bands = _bands([part.robot["to_be"].weight for part in found])
    return Plot(
        title="Attention around handoffs",
        note=f"At 0 s the robot completes its first rescue. {bands} Dotted: a robot that could "
        "have helped and does not, at the same steps.",
        traces=traces,
        x="time since the first rescue [s]",
        y="attention weight",
        levels={"even": found[0].even},
    )


def robustness_plot(document: Mapping[str, Any]) -> Plot:
    """Retention by kind of fault."""
    traces = []
    for index, one in enumerate(document["policies"]):
        known = {kind: value for kind, value in one["by_kind"].items() if value is not None}
        means = [value["mean"] for value in known.values()]
        colour = COLOURS[index % len(COLOURS)]
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": one["policy"],
                "x": [kind.replace("_", " ") for kind in known],
                "y": means,
                "marker": {"color": colour, "size": 10, "symbol": index},
                "error_y": {
                    "type": "data",
                    "symmetric": False,
                    "color": colour,
                    "array": [v["high"] - v["mean"] for v in known.values()],
                    "arrayminus": [v["mean"] - v["low"] for v in known.values()],
                },
            }
        )
    note = "Mean over robots, onsets and severities; bars are 95 % intervals."
    return Plot("Retention under faults", note, traces, "", "retention", {"nothing lost": 1.0})


def _label(part: LearningCurve | EntropyCourse | Evidence) -> str:
    return f"{part.method}, {part.situation}"


def _bands(curves: Sequence[SeedCurve]) -> str:
    kinds = dict.fromkeys(BAND_NAMES[curve.kind] for curve in curves if curve.kind != "none")
    return f"Band: {' or '.join(kinds)} over runs." if kinds else "One run, so no band."


def _line(
    name: str, x: Sequence[float], y: Sequence[float], line: Mapping[str, Any]
) -> dict[str, Any]:
    values = [None if math.isnan(value) else value for value in y]
    drawn = {"type": "scatter", "mode": "lines", "connectgaps": True, "line": line}
    return {**drawn, "name": name, "x": x, "y": values}


def _banded(
    name: str, x: Sequence[float], curve: SeedCurve, index: int, dash: str | None = None
) -> list[dict[str, Any]]:
    """A line, and a band where the curve has one."""
    colour = COLOURS[index % len(COLOURS)]
    style = {"color": colour, "dash": dash or _DASHES[index % len(_DASHES)], "width": 2.5}
    line = _line(name, x, curve.mean.tolist(), style)
    if curve.kind == "none":
        return [line]
    hidden = {"width": 0, "color": colour}
    edges = [
        {
            **_line(name, x, values.tolist(), hidden),
            "showlegend": False,
            "hoverinfo": "skip",
            "legendgroup": name,
        }
        for values in (curve.low, curve.high)
    ]
    edges[1] |= {"fill": "tonexty", "fillcolor": f"{colour}33"}
    return [*edges, {**line, "legendgroup": name}]
