"""Interactive plots of the pages about runs, as data for ``web/plots.js``. They compute nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from innerattn.envs.colours import robot_looks
from innerattn.experiments.paper.fig4 import EntropyCourse
from innerattn.experiments.paper.fig5 import Evidence
from innerattn.stats.seeds import BAND_NAMES, SeedCurve
from innerattn.studies.curves import LearningCurve

_COLOURS = 6  # of lines, and of kinds of robots, in ``web/colours.css``


@dataclass(frozen=True)
class Line:
    """A course, or values of some rows of a plot.

    Attributes:
        name: what it is.
        x: times, or numbers of rows.
        y: values at these; None where there is none.
        colour: a colour of ``web/colours.css``, such as "series-0".
        dash: 0 for a solid line, more for other dashes.
        low: lower ends of its band or intervals; empty for none.
        high: upper ends, likewise.
        thin: whether it stands back.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float | None]
    colour: str
    dash: int = 0
    low: Sequence[float | None] = ()
    high: Sequence[float | None] = ()
    thin: bool = False


@dataclass(frozen=True)
class Plot:
    """A plot.

    Attributes:
        title: what it shows.
        note: what its lines and bands are.
        lines: courses; with ``rows``, points.
        x: title of the horizontal axis.
        y: title of the values.
        levels: dashed lines by name.
        rows: names of rows, from the top; empty for courses over time.
    """

    title: str
    note: str
    lines: Sequence[Line]
    x: str
    y: str
    levels: dict[str, float]
    rows: Sequence[str] = ()

    def to_json(self) -> dict[str, Any]:
        """What the page's script draws."""
        return asdict(self)


def line_colour(index: int) -> dict[str, Any]:
    """Colour and dash of a line by its number: no two are alike among the first 36."""
    return {"colour": f"series-{index % _COLOURS}", "dash": index // _COLOURS}


def curves_plot(curves: Sequence[LearningCurve]) -> Plot:
    """Rescues in training against env-steps, of curves in the same worlds."""
    first = curves[0]
    return Plot(
        title=f"Rescues per {first.unit} of training: {first.situation}",
        note=f"{_bands([curve.rescues for curve in curves])} Dashed: scripts in the same worlds.",
        lines=[
            _banded(curve.method, curve.env_steps.tolist(), curve.rescues, **line_colour(index))
            for index, curve in enumerate(curves)
        ],
        x="env-steps",
        y=f"rescues per {first.unit}",
        levels=dict(first.scripts),
    )


def entropy_plot(course: EntropyCourse) -> Plot:
    """Attention entropy of each robot against env-steps, in the colours of the replay."""
    by_robot, times = course.by_robot(), course.env_steps.tolist()
    lines = []
    for index, (robot, look) in enumerate(
        zip(course.robots, robot_looks(course.kinds), strict=True)
    ):
        colour = f"kind-{look.kind % _COLOURS}"
        lines.append(Line(robot, times, _known(by_robot.mean[:, index]), colour, look.twin))
    return Plot(
        title=f"Attention entropy: {_label(course)}",
        note="Mean over heads, and over runs. Less is more selective; even attention is dashed.",
        lines=lines,
        x="env-steps",
        y="entropy [nats]",
        levels={f"even, ln {len(course.robots) - 1}": course.even_nats},
    )


def handoff_plot(part: Evidence) -> Plot:
    """The weights that robots give to their partners around handoffs."""
    times = (part.offsets * part.step_s).tolist()
    words = {"before": "partner of the first rescue", "to_be": "partner of the second rescue"}
    lines = []
    for index, (role, word) in enumerate(words.items()):
        colour = f"series-{index}"
        lines.append(_banded(word, times, part.robot[role].weight, colour=colour))
        control = _known(part.control[role].weight.mean)
        lines.append(Line(f"bystander, {word}", times, control, colour, 2, thin=True))
    return Plot(
        title=f"Attention around handoffs: {_label(part)}",
        note="At 0 s the robot completes its first rescue. "
        f"{_bands([part.robot['to_be'].weight])} Dotted: a robot that could have helped and does "
        "not, at the same steps.",
        lines=lines,
        x="time since the first rescue [s]",
        y="attention weight",
        levels={"even": part.even},
    )


def robustness_plot(document: Mapping[str, Any]) -> Plot:
    """Retention by kind of fault."""
    policies = document["policies"]
    kinds = list(policies[0]["by_kind"])
    lines = []
    for index, one in enumerate(policies):
        known = [(k, found) for k, kind in enumerate(kinds) if (found := one["by_kind"][kind])]
        values = {
            name: [float(found[name]) for _, found in known] for name in ("mean", "low", "high")
        }
        lines.append(
            Line(
                name=one["policy"],
                x=[k for k, _ in known],
                y=values["mean"],
                low=values["low"],
                high=values["high"],
                **line_colour(index),
            )
        )
    return Plot(
        title="Retention under faults",
        note="Mean over robots, onsets and severities; bars are 95 % intervals. Dashed: nothing is "
        "lost.",
        lines=lines,
        x="",
        y="retention",
        levels={"nothing lost": 1.0},
        rows=["all kinds" if kind == "all" else kind.replace("_", " ") for kind in kinds],
    )


def _label(part: EntropyCourse | Evidence) -> str:
    return f"{part.method}, {part.situation}"


def _bands(curves: Sequence[SeedCurve]) -> str:
    kinds = dict.fromkeys(BAND_NAMES[curve.band] for curve in curves if curve.band != "none")
    return f"Band: {' or '.join(kinds)} over runs." if kinds else "One run, so no band."


def _banded(name: str, x: Sequence[float], curve: SeedCurve, *, colour: str, dash: int = 0) -> Line:
    """A line, with a band where the curve has one."""
    ends = () if curve.band == "none" else (_known(curve.low), _known(curve.high))
    return Line(name, x, _known(curve.mean), colour, dash, *ends)


def _known(values: Any) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]
