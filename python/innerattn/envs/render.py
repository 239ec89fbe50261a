"""A picture of one world: robots, victims, obstacles and walls as seen from above.

It draws from plain arrays and needs matplotlib only when it is called.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Scenario
from innerattn.config.amounts import in_words
from innerattn.envs.colours import robot_looks

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PALE = 0.3
"""Opacity of what is painted faintly."""

_VICTIM_COLOUR = "#D55E00"
_TASK_MARKERS = "*XDP^v"
_EDGES = ("-", "--", ":", "-.")  # of robots, by their layer
_LETTER_PT = (4.9, 10.0)  # width and height of a letter of a robot's name, with its halo
_SERVED, _TIME_LEFT = "share of\nservice done", "time until\nit is lost"
_SERVICE_REACH = 0.06  # radius of the arc of a service, of the arena's half width
_ARROW_S = 0.2  # an arrow's tip is where the robot would be after so many seconds


def draw_world(
    scenario: Scenario,
    positions: NDArray[np.float32],
    velocities: NDArray[np.float32],
    victims: NDArray[np.void],
    obstacles: NDArray[np.float32],
    headings: NDArray[np.float32] | None = None,
    *,
    step: float | None = None,
    title: str = "",
    pixels: int = 600,
) -> NDArray[np.uint8]:
    """The picture of one world as pixels.

    Args:
        scenario: the world's description.
        positions: (R, 2) robots' centres [m]; NaN of robots that are not there.
        velocities: (R, 2) robots' velocities [m/s].
        victims: (V,) structured; fields ``present``, ``task``, ``x``, ``y`` [m] are used, and
            ``served`` and ``deadline_step`` where there are such.
        obstacles: (O, 2) obstacles' centres [m].
        headings: (R,) angles of robots on wheels [rad]; None: no nose is drawn.
        step: control steps done in the episode; None: it is not said how long victims still wait.
        title: text above the picture.
        pixels: height of the picture.

    Returns:
        (pixels, 4/3 pixels, 3) red, green and blue, 0 to 255.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), dpi=pixels / 6)
    canvas = FigureCanvasAgg(figure)
    world = (positions, velocities, victims, obstacles, headings)
    paint_figure(figure, scenario, *world, step=step, title=title)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels_rgba = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
    return np.asarray(pixels_rgba, np.uint8)[..., :3].copy()


def positions_of(positions: NDArray[np.float32], present: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Positions (R, 2) of the robots that are ``present`` (R,), and NaN of the others."""
    return np.where(present[:, None], positions, np.float32(np.nan))


def paint_figure(
    figure: Figure,
    scenario: Scenario,
    positions: NDArray[np.float32],
    velocities: NDArray[np.float32],
    victims: NDArray[np.void],
    obstacles: NDArray[np.float32],
    headings: NDArray[np.float32] | None = None,
    *,
    step: float | None = None,
    title: str = "",
) -> None:
    """Paint one world with its legend on an empty figure; arguments as in `draw_world`."""
    axes = figure.add_axes((0.1, 0.1, 0.63, 0.84))
    axes.set_title(title)
    world = (positions, velocities, victims, obstacles, headings)
    legend = paint_world(axes, scenario, *world, step=step)
    more = [scenario.has_wheels, "sight" in legend, _SERVED in legend, _TIME_LEFT in legend]
    low = 0.6 - 0.08 * (len(scenario.layers) - 1 + sum(more))
    figure.legend(legend.values(), legend.keys(), loc=(0.74, low), frameon=False, labelspacing=0.9)


def paint_world(
    axes: Axes,
    scenario: Scenario,
    positions: NDArray[np.float32],
    velocities: NDArray[np.float32],
    victims: NDArray[np.void],
    obstacles: NDArray[np.float32],
    headings: NDArray[np.float32] | None = None,
    *,
    step: float | None = None,
    pale: tuple[NDArray[np.bool_], NDArray[np.bool_]] | None = None,
) -> dict[str, Artist]:
    """Paint one world on ``axes``; arguments as in `draw_world`.

    Args:
        axes: where.
        scenario: of the world.
        positions: of robots.
        velocities: of robots.
        victims: by slot.
        obstacles: their centres.
        headings: of robots on wheels.
        step: of the episode.
        pale: (R,) robots and (V,) slots of victims that are painted faintly; None: none.

    Returns:
        What a legend shows: label to symbol.
    """
    half = scenario.arena_half_width_m
    axes.set(xlim=(-1.05 * half, 1.05 * half), ylim=(-1.05 * half, 1.05 * half), aspect="equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    _paint_arena(axes, scenario, obstacles)
    legend = _paint_sight(axes, scenario, positions, headings)
    pale_robots, pale_victims = pale or (np.zeros(len(positions)), np.zeros(len(victims)))
    strength = np.where(pale_victims, PALE, 1.0)
    legend |= _paint_victims(axes, scenario, victims, strength)
    legend |= _paint_services(axes, scenario, victims, strength)
    legend |= _paint_times_left(axes, scenario, victims, step, strength)
    strength = np.where(pale_robots, PALE, 1.0)
    legend |= _paint_robots(axes, scenario, positions, velocities, strength)
    return legend | _paint_noses(axes, scenario, positions, headings, strength)


def _paint_arena(axes: Axes, scenario: Scenario, obstacles: NDArray[np.float32]) -> None:
    from matplotlib.patches import Circle, Rectangle

    half = scenario.arena_half_width_m
    axes.add_patch(Rectangle((-half, -half), 2 * half, 2 * half, fill=False, linewidth=2.5))
    for stops, colour in ((scenario.stations, "#d9ead3"), (scenario.depots, "#fce5cd")):
        for stop in stops:
            axes.add_patch(Circle(stop.position_m, stop.radius_m, facecolor=colour, zorder=0))
    style: dict[str, Any] = {"edgecolor": "#444444", "zorder": 1}
    for box in scenario.map_boxes:
        (x, y), (width, height) = box.position_m or (0.0, 0.0), box.half_extents_m or (0.0, 0.0)
        colour = "#999999" if all(map(box.blocks, scenario.layers)) else "#dddddd"
        corner = (x - width, y - height)
        axes.add_patch(
            Rectangle(
                corner,
                2 * width,
                2 * height,
                facecolor=colour,
                linewidth=0.0,
                antialiased=False,
                zorder=1,
            )
        )
    for shape, (x, y) in zip(scenario.obstacles, obstacles.tolist(), strict=True):
        if not all(map(shape.blocks, scenario.layers)):
            style |= {"facecolor": "#dddddd", "linestyle": "--"}
        else:
            style |= {"facecolor": "#999999", "linestyle": "-"}
        if shape.shape == "disc":
            axes.add_patch(Circle((x, y), shape.radius_m or 0.0, **style))
        else:
            width, height = shape.half_extents_m or (0.0, 0.0)
            axes.add_patch(Rectangle((x - width, y - height), 2 * width, 2 * height, **style))


def _paint_sight(
    axes: Axes,
    scenario: Scenario,
    positions: NDArray[np.float32],
    headings: NDArray[np.float32] | None,
) -> dict[str, Artist]:
    """How far robots see, and within which angle, in their colours; below all else."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch, Rectangle, Wedge

    side = 2.0 * scenario.arena_half_width_m
    inside = Rectangle((-side / 2, -side / 2), side, side, transform=axes.transData)
    far = 1.5 * side  # beyond all that there is to see
    ahead = np.zeros(len(positions)) if headings is None else np.degrees(headings)
    looks = robot_looks(robot.kind for robot in scenario.robots)
    legend: dict[str, Artist] = {}
    for robot, look, (x, y), angle in zip(scenario.robots, looks, positions, ahead, strict=True):
        field = robot.field_of_view_deg
        if (robot.sight_m is None and field >= 360.0) or np.isnan(x):
            continue
        radius, half = robot.sight_m or far, field / 2.0
        wedge = Wedge((float(x), float(y)), radius, angle - half, angle + half, zorder=0.5)
        wedge.set(facecolor=(*to_rgb(look.colour), 0.07), edgecolor=(*to_rgb(look.colour), 0.4))
        axes.add_patch(wedge)
        wedge.set_clip_path(inside)
        legend["sight"] = Patch(facecolor=(0, 0, 0, 0.07), edgecolor=(0, 0, 0, 0.4))
    return legend


def _paint_victims(
    axes: Axes, scenario: Scenario, victims: NDArray[np.void], strength: NDArray[np.float64]
) -> dict[str, Artist]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle

    legend: dict[str, Artist] = {}
    markers = [_TASK_MARKERS[i % len(_TASK_MARKERS)] for i in range(len(scenario.tasks))]
    style: dict[str, Any] = {"color": _VICTIM_COLOUR, "linestyle": "", "markersize": 11}
    for task, marker in zip(scenario.tasks, markers, strict=True):
        legend[f"{task.name}:\n{' + '.join(in_words(task.needs))}"] = Line2D(
            [], [], marker=marker, **style
        )
    ring_style: dict[str, Any] = {"markerfacecolor": "none", "linestyle": "", "markersize": 13}
    legend["rescue radius"] = Line2D([], [], marker="o", color=_VICTIM_COLOUR, **ring_style)
    there = victims["present"].astype(bool)
    for victim, alpha in zip(victims[there], strength[there].tolist(), strict=True):
        x, y = float(victim["x"]), float(victim["y"])
        marker = markers[int(victim["task"])]
        axes.plot([x], [y], marker=marker, zorder=2, alpha=alpha, **style)
        ring = Circle((x, y), scenario.rescue_radius_m, fill=False, linestyle="--", alpha=alpha)
        ring.set_edgecolor(_VICTIM_COLOUR)
        axes.add_patch(ring)
    return legend


def _paint_services(
    axes: Axes, scenario: Scenario, victims: NDArray[np.void], strength: NDArray[np.float64]
) -> dict[str, Artist]:
    """An arc around a victim, from the top to the right: the share of its service that it had."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Arc

    if "served" not in (victims.dtype.names or ()):
        return {}
    style: dict[str, Any] = {"color": _VICTIM_COLOUR, "linewidth": 3.5, "zorder": 3.5}
    width = 2 * _SERVICE_REACH * scenario.arena_half_width_m
    begun = victims["present"].astype(bool) & (victims["served"] > 0.0)
    for victim, alpha in zip(victims[begun], strength[begun].tolist(), strict=True):
        place, had = (float(victim["x"]), float(victim["y"])), float(victim["served"])
        arc = Arc(place, width, width, theta1=90 - 360 * had, theta2=90, alpha=alpha, **style)
        axes.add_patch(arc)
    return {_SERVED: Line2D([], [], color=_VICTIM_COLOUR, linewidth=3.5)}


def _paint_times_left(
    axes: Axes,
    scenario: Scenario,
    victims: NDArray[np.void],
    step: float | None,
    strength: NDArray[np.float64],
) -> dict[str, Artist]:
    """The seconds below a victim until it is lost."""
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke

    if step is None or "deadline_step" not in (victims.dtype.names or ()):
        return {}
    ends = victims["present"].astype(bool) & (victims["deadline_step"] >= 0)
    for victim, alpha in zip(victims[ends], strength[ends].tolist(), strict=True):
        left = max(int(victim["deadline_step"]) - step, 0.0) * scenario.dt_s
        axes.annotate(
            f"{left:.1f} s",
            (float(victim["x"]), float(victim["y"])),
            xytext=(0, -9),
            textcoords="offset points",
            ha="center",
            va="top",
            alpha=alpha,
            fontsize="small",
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=5,
        )
    seconds: dict[str, Any] = {"color": "k", "linestyle": "", "markersize": 15}
    return {_TIME_LEFT: Line2D([], [], marker=r"$2.5\,\mathrm{s}$", **seconds)}


def _paint_robots(
    axes: Axes,
    scenario: Scenario,
    positions: NDArray[np.float32],
    velocities: NDArray[np.float32],
    strength: NDArray[np.float64],
) -> dict[str, Artist]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Patch
    from matplotlib.patheffects import withStroke

    legend: dict[str, Artist] = {}
    halo = [withStroke(linewidth=2.5, foreground="white")]
    looks = robot_looks(robot.kind for robot in scenario.robots)
    layers = scenario.layers
    edge: dict[str, Any]
    sides = _sides_of_names(axes, scenario, positions)
    for robot, look, (x, y), velocity, side, alpha in zip(
        scenario.robots, looks, positions, velocities, sides, strength.tolist(), strict=True
    ):
        colour = look.colour
        if robot.kind not in legend:
            legend[robot.kind] = Line2D(
                [], [], color=colour, marker="o", linestyle="", markersize=11
            )
        edge = {"edgecolor": "k", "linestyle": _EDGES[layers.index(robot.layer) % len(_EDGES)]}
        place = float(x), float(y)
        disc = Circle(place, robot.radius_m, facecolor=colour, zorder=3, alpha=alpha, **edge)
        axes.add_patch(disc)
        if np.isnan(x):
            continue
        axes.annotate(
            robot.name,
            (float(x), float(y) + side * robot.radius_m),
            xytext=(0, 2 * side),
            textcoords="offset points",
            ha="center",
            va="bottom" if side > 0 else "top",
            fontsize="small",
            path_effects=halo,
            zorder=5,
        )
        if np.hypot(*velocity) > 1e-3:
            axes.annotate(
                "",
                (float(x + _ARROW_S * velocity[0]), float(y + _ARROW_S * velocity[1])),
                xytext=(float(x), float(y)),
                arrowprops={"arrowstyle": "->", "linewidth": 1.5, "alpha": alpha},
                zorder=6,
            )
    for index, layer in enumerate(layers[1:], 1):
        edge = {"edgecolor": "k", "linestyle": _EDGES[index % len(_EDGES)]}
        legend[f"outline of\nlayer {layer}"] = Patch(facecolor="none", **edge)
    legend["velocity"] = Line2D(
        [], [], color="k", marker=r"$\rightarrow$", linestyle="", markersize=14
    )
    return legend


def _paint_noses(
    axes: Axes,
    scenario: Scenario,
    positions: NDArray[np.float32],
    headings: NDArray[np.float32] | None,
    strength: NDArray[np.float64],
) -> dict[str, Artist]:
    """Where robots on wheels point."""
    from matplotlib.lines import Line2D

    if headings is None or not scenario.has_wheels:
        return {}
    for robot, (x, y), angle, alpha in zip(
        scenario.robots, positions, headings.tolist(), strength.tolist(), strict=True
    ):
        if robot.has_wheels:
            ahead = robot.radius_m * np.array([np.cos(angle), np.sin(angle)])
            ends = [x, x + 1.5 * ahead[0]], [y, y + 1.5 * ahead[1]]
            look: dict[str, Any] = {"color": "k", "linewidth": 3, "solid_capstyle": "butt"}
            axes.plot(*ends, alpha=alpha, zorder=4, **look)
    return {"heading": Line2D([], [], color="k", linewidth=3)}


def _sides_of_names(
    axes: Axes, scenario: Scenario, positions: NDArray[np.float32]
) -> list[Literal[1, -1]]:
    """Where each robot's name covers no other robot: above it (1), if it can, or below (-1)."""
    radii = np.array([robot.radius_m for robot in scenario.robots])
    low, high = axes.get_ylim()
    metres = (high - low) / (axes.get_window_extent().height / axes.figure.dpi * 72)  # of a point
    sides: list[Literal[1, -1]] = []
    for robot, own in enumerate(scenario.robots):
        half = np.array([len(own.name) * _LETTER_PT[0], _LETTER_PT[1]]) * metres / 2
        others = np.arange(len(radii)) != robot
        above = np.array([0.0, own.radius_m + half[1]])
        covered = []
        for middle in (positions[robot] + above, positions[robot] - above):
            beyond = np.maximum(np.abs(positions[others] - middle) - half, 0.0)
            covered.append(bool((np.hypot(*beyond.T) < radii[others]).any()))
        sides.append(-1 if covered == [True, False] else 1)
    return sides
