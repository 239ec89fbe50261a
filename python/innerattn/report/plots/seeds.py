"""Runs by their seed: do runs of one seed agree, whatever their arm? It measures nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from innerattn.report.plots.drawing import BLACK, BLUE, PAGE_WIDTH_IN, SKY, VERMILION, legend_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STYLES = ((VERMILION, "s"), (BLUE, "o"), (BLUE, "^"), (SKY, "v"))
_EVEN = 0.5  # share
_REACH = 0.18  # from the first arm of a seed to its place, in places


@dataclass(frozen=True)
class SeedPanel:
    """One panel.

    Attributes:
        title: what all its runs have in common.
        arms: by their names in the legend, the same in all panels, up to four: a value for each
            seed that has a run.
    """

    title: str
    arms: Mapping[str, Mapping[int, float]]


def draw_seeds(rows: Sequence[Sequence[SeedPanel]]) -> Figure:
    """A column of dots for each seed, with a bar from the least to the largest; at least one row.

    Values are shares of the first food robot; even ones are in the middle, with a line.
    """
    from matplotlib.figure import Figure

    height = 0.6 + 1.75 * len(rows)
    figure = Figure(figsize=(PAGE_WIDTH_IN, height), layout="constrained")
    panels = figure.subplots(len(rows), len(rows[0]), sharey=True, squeeze=False)
    handles: dict[str, Any] = {}
    for row, drawn in enumerate(rows):
        for column, part in enumerate(drawn):
            handles |= _panel(panels[row, column], part)
        panels[row, 0].set_ylabel("share of the first food robot", fontsize=8)
    for panel in panels[-1]:
        panel.set_xlabel("seed", fontsize=8)
    values = [x for row in rows for part in row for arm in part.arms.values() for x in arm.values()]
    reach = max((abs(value - _EVEN) for value in values), default=0.0) + 0.05
    panels[0, 0].set_ylim(_EVEN - reach, _EVEN + reach)
    legend_below(figure, handles)
    return figure


def _panel(panel: Axes, part: SeedPanel) -> dict[str, Any]:
    """Draw one; what a legend shows."""
    by_seed: dict[int, list[float]] = {}
    for arm in part.arms.values():
        for seed, value in arm.items():
            by_seed.setdefault(seed, []).append(value)
    places = {seed: place for place, seed in enumerate(sorted(by_seed))}
    panel.axhline(_EVEN, color=BLACK, linewidth=0.7, linestyle=":")
    for seed, values in by_seed.items():
        least, most = min(values), max(values)
        panel.bar(places[seed], most - least, 0.6, least, color="#E4E4E4", zorder=0)
    handles: dict[str, Any] = {}
    for number, ((name, arm), look) in enumerate(zip(part.arms.items(), _STYLES, strict=False)):
        colour, marker = look
        apart = _REACH * (2.0 * number / max(len(part.arms) - 1, 1) - 1.0)
        x = [places[seed] + apart for seed in arm]
        (handles[name],) = panel.plot(
            x, list(arm.values()), marker, color=colour, markersize=3.4, linewidth=0.0
        )
    panel.set_title(part.title, fontsize=8)
    panel.set_xticks(list(places.values()), [str(seed) for seed in places])
    panel.tick_params(labelsize=7, length=2)
    return handles
