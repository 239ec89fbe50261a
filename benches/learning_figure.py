"""Learning curves of finished runs, with the band over seeds; it trains nothing."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from innerattn.report.plots.drawing import (
    BLACK,
    BLUE,
    COLUMN_WIDTH_IN,
    GREEN,
    ORANGE,
    PAGE_WIDTH_IN,
    PURPLE,
    SKY,
)
from innerattn.stats.seeds import seed_curve

PARTS = 40
"""Points of a curve: means over so many equal parts of a run."""
STYLES = ((BLUE, "-"), (ORANGE, "--"), (PURPLE, "-."), (GREEN, ":"), (SKY, "-"))

Array = NDArray[np.float64]


def draw_curves(folders: Mapping[tuple[str, str], Sequence[Path]]) -> Figure:
    """A column for each scenario, a curve for each method.

    Args:
        folders: of the runs of each method and scenario, one per seed.
    """
    methods = list(dict.fromkeys(method for method, _ in folders))
    presets = list(dict.fromkeys(preset for _, preset in folders))
    width = PAGE_WIDTH_IN if len(presets) > 1 else COLUMN_WIDTH_IN
    figure = Figure(figsize=(width, 2.9), layout="constrained")
    panels = figure.subplots(1, len(presets), squeeze=False)[0]
    for panel, preset in zip(panels, presets, strict=True):
        for method, (colour, style) in zip(methods, STYLES, strict=False):
            if (method, preset) in folders:
                _curve(panel, folders[method, preset], method, colour, style)
        one = next(runs[0] for (_, of), runs in folders.items() if of == preset)
        _scripts(panel, one)
        panel.set_title(preset, fontsize=9)
        panel.set_xlabel("training [1,000 env-steps]", fontsize=8)
        panel.set_ylim(0.0, 1.06 * panel.get_ylim()[1])
        panel.tick_params(labelsize=7, length=2)
    panels[0].set_ylabel("rescues per episode of 25 steps", fontsize=8)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, names, fontsize=7, ncols=len(names), loc="outside lower center", frameon=False
    )
    return figure


def _curve(panel: Axes, runs: Sequence[Path], method: str, colour: str, style: str) -> None:
    courses = [_course(run) for run in runs]
    end = min(steps[-1] for steps, _ in courses)
    edges = np.linspace(0, end, PARTS + 1)
    means = seed_curve(np.stack([_in_parts(steps, values, edges) for steps, values in courses]))
    middle = (edges[1:] + edges[:-1]) / 2000.0
    panel.plot(middle, means.mean, style, color=colour, linewidth=1.4, label=method)
    panel.fill_between(middle, means.low, means.high, color=colour, alpha=0.2, linewidth=0.0)


def _course(run: Path) -> tuple[Array, Array]:
    """Env-steps and rescues per training episode, of the times at which episodes had ended."""
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    known = [line for line in lines if line["rescues_per_episode"] is not None]
    steps, values = (
        np.array([line[name] for line in known], np.float64)
        for name in ("env_steps", "rescues_per_episode")
    )
    return steps, values


def _in_parts(steps: Array, values: Array, edges: Array) -> Array:
    """Means over the parts between the edges, (PARTS,); NaN where a part has no value."""
    part = np.clip(np.searchsorted(edges, steps) - 1, 0, PARTS - 1)
    count = np.bincount(part, minlength=PARTS)
    total = np.bincount(part, values, PARTS)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _scripts(panel: Axes, run: Path) -> None:
    """Lines at what the scripted policies rescue, named at the left."""
    summary = json.loads((run / "evaluation" / "summary.json").read_text())
    for name in ("hungarian", "greedy"):
        height = summary["scripted"][name]["mean"]
        panel.axhline(height, color=BLACK, linewidth=0.8, linestyle=(0, (1, 1)))
        panel.annotate(
            name,
            (0.02, height),
            xycoords=("axes fraction", "data"),
            xytext=(0, 1),
            textcoords="offset points",
            fontsize=6,
            va="bottom",
        )
