"""Draws the pictures of the first page, of docs/concepts.md and of crowds: `make docs`.

`python docs/pictures.py RUN` draws the first page's moving picture for a run, with attention as
arrows. Without arguments the script `hungarian` drives the team, and all pictures are drawn.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from innerattn.cli.main import main
from innerattn.config import Robot, RunConfig, Scenario, Task
from innerattn.envs import BatchEnv
from innerattn.envs.render import paint_figure
from innerattn.experiments.archive import read_archive
from innerattn.experiments.run import FinishedRun
from innerattn.stats.estimate import Estimate
from innerattn.stats.seeds import seed_estimate

IMAGES = Path(__file__).parent / "images"
RECORDS = Path(__file__).parent / "records"
ALIKE = 0.03  # margin of the studies of attention
SIGHTS_M = (4.0, 0.8, 0.4, 0.2)  # of the study of short sight
RIGHT, LEFT = 1, 2  # actions
SCRIPT = ("hungarian", "--seed", "99")
INK, GREY, BLUE, ORANGE = "#1f2933", "#7b8794", "#2b6cb0", "#c05621"
OTHER_CRITICS = (
    ("ppo-uniform", "uniform weights", BLUE),
    ("ppo-max", "largest values", "#2f855a"),
    ("ppo-oracle", "the right partners", "#6b46c1"),
    ("ppo-independent", "no teammate", INK),
    ("mappo", "a central critic", ORANGE),
)


def figure_of(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure with one plain plot [inches]."""
    figure = Figure(figsize=(width, height), layout="constrained", dpi=110)
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def world() -> Figure:
    """A world of the preset `double` after one step, as a window would show it."""
    figure = Figure(figsize=(8.0, 6.0), dpi=80)
    with BatchEnv("double", 1, seed=6) as env:
        env.reset()
        state = (env.positions(), env.velocities(), env.victims(), env.obstacles())
        paint_figure(figure, env.scenario, *(part[0] for part in state))
    return figure


def contacts() -> Figure:
    """Two robots drive head-on into each other: the distance of their centres over time."""
    figure, axes = figure_of(6.0, 2.6)
    for engine, colour, line, width in (("rapier", BLUE, "-", 3.5), ("discs", ORANGE, "o--", 1.2)):
        times, distances = head_on(engine)  # nearly the same: the thin line is over the wide one
        axes.plot(times, distances, line, ms=3, lw=width, color=colour, label=f'"{engine}"')
    axes.axhline(0.1, color=GREY, lw=1, ls=":")
    axes.text(0.0, 0.115, "twice the radius", color=GREY, fontsize=8)
    axes.set(xlabel="time [s]", ylabel="distance of centres [m]", ylim=(0.0, 0.85))
    axes.legend(frameon=False, fontsize=8)
    return figure


def head_on(engine: str) -> tuple[list[float], list[float]]:
    """Times [s] and distances [m] of two equal robots that push towards each other."""
    pair = tuple(
        Robot(name=name, kind="a", abilities=("a",), max_speed_mps=1.0, mass_kg=1.0)
        for name in ("left", "right")
    )
    scenario = Scenario(
        situation="single", robots=pair, tasks=(Task(name="t", needs=("a",)),), engine=engine
    )
    times, distances = [0.0], [0.8]
    with BatchEnv(scenario, 1, seed=0) as env:
        env.reset()
        env.set_motion([[[-0.4, 0.0], [0.4, 0.0]]], [[[0.0, 0.0], [0.0, 0.0]]])
        towards = [[RIGHT, LEFT]]
        for step in range(1, 13):
            env.step(np.array(towards))
            here = env.positions()[0]
            times.append(step * scenario.dt_s)
            distances.append(float(np.hypot(*(here[1] - here[0]))))
    return times, distances


def critic() -> Figure:
    """What goes into the attention critic, and what comes out."""
    figure, axes = figure_of(7.2, 3.2)
    axes.axis("off")
    axes.set(xlim=(0, 10), ylim=(0, 4.4))
    for y, teammate, weight in (
        (3.6, "teammate 1", 0.7),
        (2.3, "teammate 2", 0.2),
        (1.0, "teammate 3", 0.1),
    ):
        box(axes, 0.1, y, 2.2, f"{teammate}:\nobservation, action", GREY)
        axes.annotate(
            "",
            (5.2, 2.6),
            (2.35, y),
            arrowprops={"arrowstyle": "-|>", "lw": 6 * weight + 0.6, "color": BLUE},
        )
        axes.text(2.6, y + (0.22 if y > 2 else -0.35), f"weight {weight}", color=BLUE, fontsize=8)
    box(axes, 5.25, 2.6, 1.7, "weighted sum\nof values", BLUE)
    box(axes, 5.25, 0.6, 1.7, "the robot's own\nobservation", GREY)
    box(axes, 8.0, 2.6, 1.9, "Q of each of its\nown actions", ORANGE)
    for start, end in (((6.98, 2.6), (7.98, 2.6)), ((6.98, 0.7), (8.2, 2.15))):
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": INK})
    axes.annotate(
        "query",
        (5.6, 2.15),
        (5.6, 1.1),
        arrowprops={"arrowstyle": "-|>", "color": BLUE},
        color=BLUE,
        fontsize=8,
    )
    return figure


def box(axes: Axes, x: float, y: float, width: float, text: str, colour: str) -> None:
    """A framed text whose left side is in the middle of its height at (x, y)."""
    shape = {"boxstyle": "round,pad=0.35", "fc": "white", "ec": colour}
    axes.text(x + width / 2, y, text, ha="center", va="center", fontsize=8.5, color=INK, bbox=shape)


def score() -> Figure:
    """The scale of scores."""
    figure, axes = figure_of(6.4, 1.5)
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.set(xlim=(-0.08, 1.15), ylim=(-0.9, 1.0), yticks=[], xticks=[])
    axes.plot([0, 1.1], [0, 0], color=GREY, lw=1.2)
    for at, name, up in ((0.0, "random\n0", True), (1.0, "hungarian\n1", True)):
        axes.plot(at, 0, "|", ms=14, color=INK)
        axes.text(at, 0.25 if up else -0.3, name, ha="center", va="bottom", fontsize=9, color=INK)
    axes.annotate(
        "a team:  (its rescues − random's) / (hungarian's − random's)",
        (0.93, 0.0),
        (0.45, -0.75),
        ha="center",
        fontsize=9,
        color=BLUE,
        arrowprops={"arrowstyle": "-|>", "color": BLUE},
    )
    return figure


def sight() -> Figure:
    """What short sight costs, and what talking gives back: runs of examples/studies/sight.toml."""
    runs: dict[str, list[FinishedRun]] = {}
    for run in read_archive(RECORDS / "sight.parquet"):
        runs.setdefault(_how_it_sees(run.config), []).append(run)
    figure, axes = figure_of(7.2, 2.9)
    names = ["all is seen", "0.8 m, silent", "0.8 m, learnt messages", "0.8 m, told of victims"]
    for row, name in enumerate(names):
        found = [run.summary["rescues_per_episode"]["mean"] for run in runs[name]]
        axes.barh(row, np.mean(found), height=0.55, color=BLUE, alpha=0.35)
        axes.plot(found, [row] * len(found), "o", color=BLUE, ms=4)
        axes.text(0.05, row, f"{np.mean(found):.2f}", va="center", fontsize=9, color=INK)
        script = runs[name][0].summary["scripted"].get("greedy-seen")
        if script is not None:
            axes.plot(script["mean"], row, "|", ms=22, mew=2, color=ORANGE)
    axes.plot([], [], "o", color=BLUE, ms=4, label="a trained team (a seed)")
    axes.plot([], [], "|", ms=10, mew=2, color=ORANGE, label="script of like sight")
    best = runs[names[0]][0].summary["scripted"]["hungarian"]["mean"]
    axes.axvline(best, color=GREY, lw=1.2, ls="--", label="hungarian, which sees all")
    axes.set(
        yticks=range(len(names)), yticklabels=names, xlabel="rescues per episode", xlim=(0, 3.4)
    )
    axes.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    return figure


def _how_it_sees(config: RunConfig) -> str:
    if config.scenario.robots[0].sight_m is None:
        return "all is seen"
    if config.scenario.communication is not None:
        return "0.8 m, told of victims"
    return "0.8 m, learnt messages" if config.network.message_width else "0.8 m, silent"


def crowd() -> Figure:
    """What learnt attention gains in a crowd: runs of examples/studies/crowd.toml, full length."""
    scores: dict[str, dict[int, dict[int, float]]] = {}
    for run in read_archive(RECORDS / "crowd.parquet"):
        config, method = run.config, run.config.train.method
        robots = len(config.scenario.robots)
        if _in_full_crowd(config):
            of_size = scores.setdefault(method, {}).setdefault(robots, {})
            of_size[config.train.seed] = run.summary["score"]["mean"]
    figure, axes = figure_of(7.2, 3.2)
    learnt = scores.pop("ppo-inner")
    for place, (method, name, colour) in enumerate(OTHER_CRITICS):
        for robots, found in sorted(scores[method].items()):
            seeds = sorted(found.keys() & learnt[robots].keys())
            gain = seed_estimate([learnt[robots][seed] - found[seed] for seed in seeds])
            at = robots * 1.06 ** (place - 2)
            axes.plot([at, at], [gain.low, gain.high], color=colour, lw=1.5)
            axes.plot(at, gain.mean, "o", color=colour, ms=4, label=name)
            name = "_"  # once in the legend
    axes.axhspan(-0.03, 0.03, color=GREY, alpha=0.15, lw=0)
    axes.set(xscale="log", xlabel="robots", ylabel="score, learnt attention - other")
    axes.set_xticks(sorted(learnt), [str(robots) for robots in sorted(learnt)])
    axes.minorticks_off()
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    return figure


def attention_map() -> Figure:
    """What learnt attention gains over equal weights, by robots, in runs that are published."""
    critic = (("train", "method"), ("network", "attention")), "ppo-inner", "ppo-uniform"
    actor = (("network", "pooling"),), "attention", "mean"
    panels: dict[str, dict[str, dict[int, Estimate]]] = {
        "in the critic": {
            "mixed": _gains("fast", *critic, _in_mixed),
            "sites far apart": _gains("crowd", *critic, _in_full_crowd),
        },
        "in the encoders": {"mixed": _gains("actor", *actor, _in_mixed)},
    }
    for sight_m in SIGHTS_M:
        row = f"sight {sight_m:g} m"
        for rows, keys in zip(panels.values(), (critic, actor), strict=True):
            rows[row] = _gains("short_sight", *keys, partial(_sees_so_far, sight_m))
    names = list(panels["in the critic"])
    sizes = [
        sorted({robots for row in rows.values() for robots in row}) for rows in panels.values()
    ]
    figure = Figure(figsize=(7.2, 3.4), layout="constrained", dpi=110)
    places = figure.subplots(1, 2, width_ratios=[len(of_panel) for of_panel in sizes])
    for axes, (title, rows), of_panel in zip(places, panels.items(), sizes, strict=True):
        _paint_gains(axes, [rows.get(name, {}) for name in names], of_panel)
        axes.set_title(title, fontsize=9)
    places[0].set_yticks(range(len(names)), names)
    places[1].set_yticks([])
    return figure


def _paint_gains(axes: Axes, rows: Sequence[dict[int, Estimate]], sizes: Sequence[int]) -> None:
    """A field for each row and number of robots, with a gain where there are runs."""
    for row, gains in enumerate(rows):
        for column, robots in enumerate(sizes):
            gain = gains.get(robots)
            colour = "#f0f0f0" if gain is None else colormaps["RdBu"](0.5 + gain.mean / 0.2)
            axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fc=colour, ec="white", lw=2))
            if gain is not None:
                decided = gain.low > 0 or gain.high < 0 or max(-gain.low, gain.high) < ALIKE
                text = f"{gain.mean:+.2f}".replace("-0.00", "+0.00")
                text += " \u25cf" if decided else ""
                axes.text(column, row, text, ha="center", va="center", fontsize=8, color=INK)
    axes.set(xlim=(-0.5, len(sizes) - 0.5), ylim=(len(rows) - 0.5, -0.5), xlabel="robots")
    axes.set_xticks(range(len(sizes)), [str(robots) for robots in sizes])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _gains(
    archive: str,
    keys: Sequence[tuple[str, str]],
    one: str,
    other: str,
    takes: Callable[[RunConfig], bool],
) -> dict[int, Estimate]:
    """Score of runs less that of runs that differ in some keys alone, by robots.

    Args:
        archive: name of the published runs.
        keys: sections and keys that differ; the first has the values ``one`` and ``other``.
        one: value of the runs that are looked at.
        other: value of those beside which they stand.
        takes: which runs count.
    """
    scores: dict[tuple[int, str], dict[str, dict[int, float]]] = {}
    for run in read_archive(RECORDS / f"{archive}.parquet"):
        config, values = run.config, run.config.in_use()
        if not takes(config):
            continue
        section, key = keys[0]
        value = values[section][key]
        for section, key in (*keys, ("train", "seed"), ("evaluate", "seed")):
            del values[section][key]
        rest = len(config.scenario.robots), json.dumps(values, sort_keys=True)
        of_value = scores.setdefault(rest, {}).setdefault(value, {})
        of_value[config.train.seed] = run.summary["score"]["mean"]
    gains = {}
    for (robots, _), found in scores.items():
        if one in found and other in found:
            seeds = sorted(found[one].keys() & found[other].keys())
            gain = seed_estimate([found[one][seed] - found[other][seed] for seed in seeds])
            assert robots not in gains, f"{archive}: two recipes for {robots} robots"
            assert gain is not None, f"{archive}: no seed of both for {robots} robots"
            gains[robots] = gain
    return gains


def _in_mixed(config: RunConfig) -> bool:
    """Whether a run is one of the preset mixed, or of its larger teams."""
    return config.scenario.situation == "mixed"


def _sees_so_far(sight_m: float, config: RunConfig) -> bool:
    """Whether the robots of a run see so far."""
    return config.scenario.robots[0].sight_m == sight_m


def _in_full_crowd(config: RunConfig) -> bool:
    """Whether a run of the crowd has the full length, and observations without teammates."""
    return config.scenario.observed_teammates == 0 and _site_steps(config) > 350_000


def _site_steps(config: RunConfig) -> int:
    return config.train.env_steps * len(config.scenario.tasks)


if __name__ == "__main__":
    code = main(["replay", *(sys.argv[1:] or SCRIPT), "-o", str(IMAGES / "rescue.gif")])
    if not sys.argv[1:]:
        for draw in (world, contacts, critic, score, sight):
            draw().savefig(IMAGES / f"concept_{draw.__name__}.png")
        crowd().savefig(IMAGES / "attention_crowd.png")
        attention_map().savefig(IMAGES / "attention_map.png")
    sys.exit(code)
