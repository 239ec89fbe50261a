"""Fig. 5: one handoff as it went; it chooses and measures nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from innerattn.envs.colours import robot_looks
from innerattn.experiments.paper.scene import HandoffScene
from innerattn.report.plots.drawing import (
    BLACK,
    PAGE_WIDTH_IN,
    TWIN_DASHES,
    VERMILION,
    labelled,
    legend_below,
)
from innerattn.report.plots.names import place_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

    _Names: TypeAlias = tuple[Sequence[Annotation], Sequence[Annotation]]
    """Of robots and of victims."""

_MARKERS = "oo^s"  # of robots by index; further ones are diamonds
_VICTIM_MARKERS = "*XP"
_ROBOT_PT, _VICTIM_PT = 6.0, 8.0  # sizes of markers
_GAP_PT = 3.0  # between a name and what it names
_STAGES = ("(i) before", "(ii) between", "(iii) after")


def draw_handoff(scene: HandoffScene) -> Figure:
    """Panels A (positions in three stages), B (weights, mean over heads) and C (each head)."""
    from matplotlib.figure import Figure

    heads = scene.weights.shape[1]
    figure = Figure(figsize=(PAGE_WIDTH_IN, 6.6), layout="constrained")
    parts: Any = figure.subfigures(3, 1, height_ratios=(2.55, 1.75, 1.6))
    upper, middle, lower = parts
    arenas = upper.subplots(1, len(_STAGES), squeeze=False)[0]
    named = []
    for panel, name, stage in zip(arenas, _STAGES, scene.stages, strict=True):
        named.append(_arena(panel, scene, stage))
        panel.set_title(f"{name}: step {stage[1]}", fontsize=8)
    panel_b = middle.subplots(1, 1)
    _weights(panel_b, scene, scene.weights.mean(1))
    panel_b.set_ylabel("weight, mean over heads", fontsize=8)
    panel_b.set_xlabel(f"step of the episode [{scene.scenario.dt_s:g} s each]", fontsize=8)
    top = panel_b.get_ylim()[1]
    for step, task, partner in zip(
        (scene.first, scene.second), scene.tasks, (scene.before, scene.after), strict=True
    ):
        panel_b.annotate(
            f"{task} done with\n{scene.scenario.robots[partner].name} ",
            (step + 0.5, top),
            xytext=(-2, -3),
            textcoords="offset points",
            fontsize=6.5,
            ha="right",
            va="top",
        )
    for name, (_, now) in zip(_STAGES, scene.stages, strict=True):
        panel_b.annotate(name.split()[0], (now, 0.02), fontsize=6.5, ha="center")
    panels = lower.subplots(1, heads, sharey=True, squeeze=False)[0]
    for head, panel in enumerate(panels):
        _weights(panel, scene, scene.weights[:, head])
        panel.set_title(f"head {head + 1}", fontsize=8)
        panel.set_xlabel(f"step [{scene.scenario.dt_s:g} s]", fontsize=8)
    panels[0].set_ylabel("weight", fontsize=8)
    for first, letter in ((arenas[0], "A"), (panel_b, "B"), (panels[0], "C")):
        first.set_title(letter, loc="left", fontsize=11, fontweight="bold")
    legend_below(lower, labelled(panels[0]))
    robot = scene.scenario.robots[scene.robot].name
    figure.suptitle(f"{robot} hands over: {scene.title}", fontsize=9)
    figure.draw_without_rendering()  # lays it out, so that it is known what covers what
    for panel, names, stage in zip(arenas, named, scene.stages, strict=True):
        _place(panel, names, scene, stage, figure.dpi / 72.0)
    return figure


def _arena(panel: Axes, scene: HandoffScene, stage: tuple[int, int]) -> _Names:
    """Draw a stage; its names are yet to be placed."""
    from matplotlib.patches import Circle, Rectangle
    from matplotlib.patheffects import withStroke

    since, now = stage
    half = scene.scenario.arena_half_width_m
    panel.set(xlim=(-1.08 * half, 1.08 * half), ylim=(-1.08 * half, 1.08 * half), aspect="equal")
    panel.add_patch(Rectangle((-half, -half), 2 * half, 2 * half, fill=False, linewidth=1.2))
    panel.set_xlabel("x [m]", fontsize=8)
    panel.set_ylabel("y [m]", fontsize=8)
    panel.set_xticks([-half, 0, half])
    panel.set_yticks([-half, 0, half])
    panel.tick_params(labelsize=7, length=2)
    halo = [withStroke(linewidth=1.8, foreground="white")]
    text: dict[str, Any] = {
        "fontsize": 6,
        "xytext": (0, 0),
        "textcoords": "offset points",
        "path_effects": halo,
        "zorder": 6,
        "in_layout": False,
    }
    robots, victims = [], []
    looks = robot_looks(robot.kind for robot in scene.scenario.robots)
    for r, robot in enumerate(scene.scenario.robots):
        colour, own = looks[r].colour, r == scene.robot
        trail = scene.positions[since : now + 1, r]
        panel.plot(*trail.T, color=colour, linewidth=1.6 if own else 0.9, zorder=3)
        edge: dict[str, Any] = {"markeredgecolor": BLACK, "markeredgewidth": 1.2 if own else 0.4}
        style: dict[str, Any] = {"color": colour, "markersize": _ROBOT_PT, "zorder": 4, **edge}
        panel.plot(*trail[-1:].T, _marker(r), **style)
        weight = "bold" if own else "normal"
        robots.append(panel.annotate(robot.name, tuple(trail[-1]), fontweight=weight, **text))
    radius = scene.scenario.rescue_radius_m
    for victim in _present(scene, now):
        x, y, task = float(victim["x"]), float(victim["y"]), int(victim["task"])
        marker = _VICTIM_MARKERS[task % len(_VICTIM_MARKERS)]
        style = {"color": VERMILION, "markersize": _VICTIM_PT, "markeredgewidth": 0.0, "zorder": 2}
        panel.plot([x], [y], marker, **style)
        ring = Circle((x, y), radius, fill=False, linestyle="--")
        ring.set(edgecolor=VERMILION, linewidth=0.7)
        panel.add_patch(ring)
        name = scene.scenario.tasks[task].name
        victims.append(panel.annotate(name, (x, y), color=VERMILION, **text))
    return robots, victims


def _present(scene: HandoffScene, now: int) -> NDArray[np.void]:
    """The victims that are there at a step."""
    victims: NDArray[np.void] = scene.victims[now]
    there: NDArray[np.void] = victims[victims["present"].astype(bool)]
    return there


def _place(
    panel: Axes, names: _Names, scene: HandoffScene, stage: tuple[int, int], point_px: float
) -> None:
    """Put the names where they cover no robot, victim or trail, as far as that can be."""
    from matplotlib.transforms import Bbox

    since, now = stage
    robots, victims = names
    half, radius = scene.scenario.arena_half_width_m, scene.scenario.rescue_radius_m
    to_px = panel.transData.transform
    arena = Bbox(to_px([(-half, -half), (half, half)]))
    ring_pt = radius * arena.width / (2.0 * half) / point_px
    there = _present(scene, now)
    marks = []
    for points, size_pt in (
        (scene.positions[now], _ROBOT_PT),
        (np.stack([there["x"], there["y"]], -1), _VICTIM_PT),
        (scene.positions[since:now].reshape(-1, 2), 1.0),
    ):
        side = size_pt * point_px
        corners = np.asarray(to_px(points)) - side / 2.0
        marks += [Bbox.from_bounds(x, y, side, side) for x, y in corners]
    own_first = sorted(robots, key=lambda name: name is not robots[scene.robot])
    beside = [(name, _ROBOT_PT / 2.0 + _GAP_PT) for name in own_first]
    beside += [(name, ring_pt + _GAP_PT) for name in victims]
    place_names(beside, arena, marks)


def _weights(panel: Axes, scene: HandoffScene, weights: NDArray[np.float32]) -> None:
    """Weights (T, R) on the teammates over the steps of the handoff."""
    from matplotlib.ticker import MaxNLocator

    steps = np.arange(scene.start, scene.second + 1)
    looks = robot_looks(robot.kind for robot in scene.scenario.robots)
    for r, robot in enumerate(scene.scenario.robots):
        if r != scene.robot:
            style = f"{_marker(r)}{TWIN_DASHES[looks[r].twin % len(TWIN_DASHES)]}"
            panel.plot(steps, weights[steps, r], style, color=looks[r].colour, linewidth=1.3,
                       markersize=2.5, label=f"on {robot.name}")  # fmt: skip
    even = 1.0 / (len(scene.scenario.robots) - 1)
    panel.axhline(even, color=BLACK, linewidth=0.7, linestyle=":", label="even attention")
    for step in (scene.first, scene.second):
        panel.axvline(step + 0.5, color=BLACK, linewidth=0.9, linestyle="--")
    panel.set(xlim=(scene.start - 0.3, scene.second + 0.8), ylim=(0.0, 1.0))
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.tick_params(labelsize=7, length=2)


def _marker(robot: int) -> str:
    return _MARKERS[robot] if robot < len(_MARKERS) else "D"
