"""One recorded episode as a moving picture: a GIF, or a video where its library is installed."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import Robot, Scenario
from innerattn.envs.render import PALE, paint_world, positions_of
from innerattn.errors import MissingLibraryError, RunError
from innerattn.measures.moments import handoffs_of_all_robots, obstacle_places
from innerattn.records.record import Record
from innerattn.report.replay.data import refuse_what_cannot_replay
from innerattn.report.replay.moments import ATTENTION_OF, Whose
from innerattn.report.replay.sight import in_sight, sees_all

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch
    from PIL.Image import Image

PIXELS = 400
"""Height of a moving picture."""

_FRAMES_PER_STEP = 2
_FRAME_MS = 100
_LAST_MS = 1500
_COLOURS = 128
_WIDEST_PT = 14.0  # an arrow for a weight of 1
_VIDEO_FPS = 1000 // _FRAME_MS


def moving_picture(
    records: Sequence[Record],
    names: Sequence[str],
    suffix: str,
    *,
    episode: int | None = None,
    robot: str | None = None,
    attention: Whose | None = None,
) -> bytes:
    """An episode of each policy side by side, two frames for each control step.

    Args:
        records: of one to four policies, in the same worlds, recorded step by step.
        names: what each is called.
        suffix: ".gif", or ".mp4" (which needs imageio-ffmpeg).
        episode: its number; None: the one in which the first policy with attention (or the first)
            hands over and rescues most.
        robot: name of the robot whose attention is drawn, or "all"; None: the first that hands
            over, or the first of the team.
        attention: of the "critic" or the "actor"; None: of the critic, if one was recorded.

    Returns:
        The contents of the file.

    Raises:
        RunError: records cannot be replayed, or there is no such episode, robot or attention.
        MissingLibraryError: Matplotlib, or for a video imageio-ffmpeg, is not installed.
    """
    refuse_what_cannot_replay(records, names)
    field = _drawn_attention(records, attention)
    index = _chosen_episode(records, episode, field)
    drawn = _drawn_robots(records, index, robot, field)
    try:
        frames = list(_frames(records, names, index, drawn, field))
    except ImportError as error:
        raise _missing("a moving picture", "matplotlib") from error
    return _video(frames) if suffix == ".mp4" else _gif(frames)


def _missing(what: str, library: str) -> MissingLibraryError:
    return MissingLibraryError(f"{what} needs {library}: pip install 'innerattn[report]'")


def _drawn_attention(records: Sequence[Record], whose: Whose | None) -> str:
    """The recorded field that has the attention to draw; that of the critic, if there is none."""
    recorded = [f for f in ATTENTION_OF.values() if any(f in record.steps for record in records)]
    if whose is None:
        return recorded[0] if recorded else ATTENTION_OF["critic"]
    if ATTENTION_OF[whose] not in recorded:
        raise RunError(f"--attention {whose}: no policy has any that was recorded")
    return ATTENTION_OF[whose]


def _chosen_episode(records: Sequence[Record], number: int | None, attention: str) -> int:
    """Position of the episode in the records."""
    first, count = records[0].first_episode, records[0].num_episodes
    if number is not None:
        if not first <= number < first + count:
            raise RunError(
                f"--episode {number}: must be {first} to {first + count - 1}, which were recorded"
            )
        return number - first
    record = _told_first(records, attention)
    handed = np.bincount(handoffs_of_all_robots(record)["episode"] - first, minlength=count)
    return int(np.argmax(10 * handed + record.rescue_counts()))


def _told_first(records: Sequence[Record], attention: str) -> Record:
    """The first with attention, or the first."""
    return next((record for record in records if attention in record.steps), records[0])


def _drawn_robots(
    records: Sequence[Record], episode: int, robot: str | None, attention: str
) -> tuple[str, ...]:
    """Names of the robots whose attention is drawn."""
    names = records[0].robot_names
    if robot is None:
        record = _told_first(records, attention)
        handed = handoffs_of_all_robots(record)
        handed = handed[handed["episode"] == record.first_episode + episode]
        return (names[int(handed["robot"][0]) if len(handed) else 0],)
    if robot in names:
        return (robot,)
    if robot == "all":
        return names
    raise RunError(f"--robot {robot}: must be all, or one of {', '.join(names)}")


def _frames(
    records: Sequence[Record],
    names: Sequence[str],
    episode: int,
    robots: Sequence[str],
    attention: str,
) -> Iterator[NDArray[np.uint8]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    steps = max(int(record.lengths[episode]) for record in records)
    places = obstacle_places(records[0])[episode]
    share = 1.0 / (len(records) + 0.33)  # the legend takes the rest
    for moment in np.arange((steps - 1) * _FRAMES_PER_STEP + 1) / _FRAMES_PER_STEP:
        figure = Figure(figsize=(6.0 / share, 6.0), dpi=PIXELS / 6)
        canvas = FigureCanvasAgg(figure)
        for number, (record, name) in enumerate(zip(records, names, strict=True)):
            axes = figure.add_axes(((number + 0.02) * share, 0.02, 0.96 * share, 0.9))
            legend = _paint(axes, record, name, episode, float(moment), places, robots, attention)
        figure.legend(
            legend.values(),
            legend.keys(),
            loc="upper left",
            bbox_to_anchor=(len(records) * share, 0.97),
            borderaxespad=0.0,
            frameon=False,
            labelspacing=0.9,
        )
        if any(attention in record.steps for record in records):
            whose = robots[0] if len(robots) == 1 else "all robots"
            of_actors = attention == ATTENTION_OF["actor"]
            where = (len(records) + 0.03) * share
            figure.text(
                where,
                0.05,
                f"wide arrows: attention\n{'in the actor ' * of_actors}of {_plain(whose)}",
                va="bottom",
            )
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
        frame = np.asarray(pixels, np.uint8)[..., :3]
        yield frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2].copy()  # even, for videos


def _paint(
    axes: Axes,
    record: Record,
    name: str,
    episode: int,
    moment: float,
    obstacles: NDArray[np.float32],
    robots: Sequence[str],
    attention: str,
) -> dict[str, Artist]:
    last = int(record.lengths[episode]) - 1
    now = min(int(moment), last)
    kept = {field: values[episode, now] for field, values in record.steps.items()}
    later = record.steps["positions"][episode, min(now + 1, last)]
    positions = kept["positions"] + np.float32(moment - int(moment)) * (later - kept["positions"])
    if record.scenario.robots_leave and "faults" in kept:
        positions = positions_of(positions, kept["faults"]["unavailable"] < 1.0)
    headings = kept["headings"][:, 0] if "headings" in kept else None
    world = (positions, kept["velocities"], kept["victims"], obstacles, headings)
    seen_by = record.robot_names.index(robots[0]) if len(robots) == 1 else None
    pale = None
    if seen_by is not None and not sees_all(record.scenario, seen_by):
        pale = _out_of_sight(
            record.scenario, seen_by, positions, headings, kept["victims"], obstacles
        )
    legend = paint_world(axes, record.scenario, *world, step=moment, pale=pale)
    if pale is not None:
        legend[f"out of sight\nof {_plain(robots[0])}"] = _pale_mark()
    discs = axes.patches[-record.scenario.num_robots :]
    axes.set(xlabel="", ylabel="", xticks=[], yticks=[])
    axes.set_axis_off()
    events = record.rescues[record.rescues["episode"] == record.first_episode + episode]
    done = int((events["step"] <= now).sum())
    count = "1 rescue" if done == 1 else f"{done} rescues"
    axes.set_title(f"{_plain(name)}: {now * record.scenario.dt_s:.1f} s, {count}", fontsize=13)
    for event in events[events["step"] == now]:
        _paint_rescue(axes, record, kept["victims"][event["slot"]])
    if "rays" in kept:
        for one in robots:
            index = record.robot_names.index(one)
            ahead = 0.0 if headings is None else float(headings[index])
            at, rays, colour = positions[index], kept["rays"][index], discs[index].get_facecolor()
            _paint_rays(axes, record.scenario.robots[index], at, ahead, rays, colour)
    if attention in kept and record.scenario.num_robots > 1:
        for one in robots:
            index = record.robot_names.index(one)
            weights = kept[attention].mean(0)[index]
            _paint_attention(axes, positions, index, weights, discs[index])
    return legend


def _out_of_sight(
    scenario: Scenario,
    robot: int,
    positions: NDArray[np.float32],
    headings: NDArray[np.float32] | None,
    victims: NDArray[np.void],
    obstacles: NDArray[np.float32],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The other robots (R,) and the victims (V,) that a robot does not see."""
    ahead = 0.0 if headings is None else float(headings[robot])
    places = np.stack([victims["x"], victims["y"]], -1)
    robots, slots = (
        ~in_sight(scenario, robot, positions[robot], ahead, obstacles, some)
        for some in (positions, places)
    )
    robots[robot] = False
    return robots, slots & victims["present"].astype(bool)


def _pale_mark() -> Artist:
    from matplotlib.lines import Line2D

    look: dict[str, Any] = {"color": "k", "linestyle": "", "markersize": 11}
    return Line2D([], [], marker="o", alpha=PALE, **look)


def _plain(text: str) -> str:
    """Text that Matplotlib takes for no formula."""
    return text.replace("$", r"\$")


def _paint_rescue(axes: Axes, record: Record, victim: np.void) -> None:
    from matplotlib.patches import Circle

    place = float(victim["x"]), float(victim["y"])
    axes.add_patch(Circle(place, record.scenario.rescue_radius_m, color="#D55E00", alpha=0.35))


def _paint_rays(
    axes: Axes,
    robot: Robot,
    place: NDArray[np.float32],
    ahead: float,
    readings: NDArray[np.float32],
    colour: Any,
) -> None:
    """A robot's rays, each up to what it meets; one that meets nothing is pale."""
    sensor = robot.range_sensor
    if sensor is None or np.isnan(place).any():
        return
    for angle, reading in zip(sensor.angles_rad(), readings.tolist(), strict=False):
        far = (1.0 - reading) * sensor.range_m
        end = place + far * np.array([np.cos(ahead + angle), np.sin(ahead + angle)])
        line = np.array([place, end]).T
        axes.plot(*line, color=colour, alpha=0.75 if reading > 0.0 else 0.2, lw=0.9, zorder=2.2)


def _paint_attention(
    axes: Axes,
    positions: NDArray[np.float32],
    robot: int,
    weights: NDArray[np.float32],
    disc: Patch,
) -> None:
    """Arrows from a robot to its teammates, as wide as the weights (R,)."""
    from matplotlib.patches import FancyArrowPatch

    colour = 0.65 * np.asarray(disc.get_facecolor()[:3]) + 0.35
    for other, weight in enumerate(weights.tolist()):
        width = weight * _WIDEST_PT
        if other == robot or width < 0.4 or np.isnan(positions[[robot, other]]).any():
            continue
        arrow = FancyArrowPatch(
            tuple(positions[robot].tolist()),
            tuple(positions[other].tolist()),
            connectionstyle="arc3,rad=0.15",
            arrowstyle=f"-|>,head_length={4 + 0.6 * width},head_width={2 + 0.6 * width}",
            mutation_scale=1.0,
            shrinkA=0.0,
            shrinkB=11.0,
            linewidth=width,
            capstyle="butt",
            joinstyle="miter",
            color=tuple(colour.tolist()),
            zorder=2.5,
        )
        axes.add_patch(arrow)


def _gif(frames: Sequence[NDArray[np.uint8]]) -> bytes:
    """All frames in colours that they share; the last one stays for a moment."""
    from PIL.Image import Dither

    pictures = [_image(frame) for frame in frames]
    palette = pictures[len(pictures) // 2].quantize(_COLOURS)
    small = [picture.quantize(palette=palette, dither=Dither.NONE) for picture in pictures]
    durations = [_FRAME_MS] * (len(small) - 1) + [_LAST_MS]
    data = io.BytesIO()
    small[0].save(data, "GIF", save_all=True, append_images=small[1:], duration=durations, loop=0)
    return data.getvalue()


def _image(frame: NDArray[np.uint8]) -> Image:
    from PIL import Image

    return Image.fromarray(frame)


def _video(frames: Sequence[NDArray[np.uint8]]) -> bytes:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise _missing("a video", "imageio-ffmpeg") from error
    height, width, _ = frames[0].shape
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.mp4"
        writer = imageio_ffmpeg.write_frames(
            str(path), (width, height), fps=_VIDEO_FPS, macro_block_size=2, quality=8
        )
        writer.send(None)
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
        writer.close()
        return path.read_bytes()
