"""Moving pictures: two frames for each step, arrows where there is attention, clear refusals."""

import io
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from PIL import Image
from watched import watched

from innerattn.config import RangeSensor, Scenario
from innerattn.errors import MissingLibraryError, RunError
from innerattn.report.replay.moments import Whose
from innerattn.report.replay.picture import _paint, moving_picture

SHORT = Scenario.preset("mixed").replace(episode_steps=4)


def frames(data: bytes) -> list[np.ndarray]:
    picture = Image.open(io.BytesIO(data))
    found = []
    for index in range(picture.n_frames):
        picture.seek(index)
        found.append(np.asarray(picture.convert("RGB")).astype(int))
    return found


def test_a_gif_has_two_frames_for_each_step() -> None:
    record = watched(SHORT, episodes=2)
    found = frames(moving_picture([record], ["$a_1$ <b>"], ".gif"))
    assert len(found) == 2 * 4 - 1
    assert all((one != other).any() for one, other in pairwise(found))
    both = frames(moving_picture([record, record], ["a", "b"], ".gif", episode=1))
    assert both[0].shape[1] > 1.5 * found[0].shape[1]


def test_rays_of_the_chosen_robot_end_where_they_meet_something() -> None:
    sensor = RangeSensor(rays=8, range_m=0.8)
    first, *others = SHORT.robots
    scenario = SHORT.replace(robots=(first.replace(range_sensor=sensor), *others))
    record = watched(scenario)
    axes = Figure().add_subplot()
    places = np.zeros((0, 2), np.float32)
    _paint(axes, record, "a", 0, 1.0, places, ("food_0",), "attention")
    lines = [one.get_xydata() for one in axes.lines if len(one.get_xydata()) == 2]
    readings, at = record.steps["rays"][0, 1, 0], record.steps["positions"][0, 1, 0]
    assert len(lines) == 8
    assert readings.any()
    for ray, (line, reading) in enumerate(zip(lines, readings, strict=True)):
        np.testing.assert_allclose(line[0], at, atol=1e-6)
        angle, far = 2 * np.pi * ray / 8, (1 - reading) * 0.8
        np.testing.assert_allclose(
            line[1] - at, far * np.array([np.cos(angle), np.sin(angle)]), atol=1e-5
        )
    axes = Figure().add_subplot()
    _paint(axes, record, "a", 0, 1.0, places, ("food_1",), "attention")
    assert not [one for one in axes.lines if len(one.get_xydata()) == 2]


def test_services_and_deadlines_of_victims_are_drawn() -> None:
    """An arc of the share that was recorded, and the time that is left at each half step."""
    tasks = [one.replace(service_s=2.0, deadline_s=8.0) for one in SHORT.tasks]
    record = watched(SHORT.replace(tasks=tasks, episode_steps=40))
    victims = record.steps["victims"]
    served = np.where(victims["present"], victims["served"], 0.0)
    episode, step, slot = (int(one[0]) for one in np.nonzero((served > 0.2) & (served < 0.8)))
    victim = victims[episode, step, slot]
    axes = Figure().add_subplot()
    places = np.zeros((0, 2), np.float32)
    _paint(axes, record, "a", episode, step + 0.5, places, ("food_0",), "attention")
    arcs = [one for one in axes.patches if isinstance(one, Arc) and one.center[0] == victim["x"]]
    assert [one.theta2 - one.theta1 for one in arcs] == [pytest.approx(360 * victim["served"])]
    left = (victim["deadline_step"] - step - 0.5) * SHORT.dt_s
    texts = [one for one in axes.texts if one.get_text().endswith(" s")]
    assert f"{left:.1f} s" in [one.get_text() for one in texts if one.xy[0] == victim["x"]]


@pytest.mark.long
def test_arrows_are_of_the_robots_that_were_asked_for() -> None:
    without, record = watched(SHORT, heads=0), watched(SHORT)
    painted = {
        robot: frames(moving_picture([one], ["a"], ".gif", episode=0, robot=robot))[0]
        for one, robot in ((without, "food_1"), (record, "medical_0"), (record, "all"))
    }
    inside = (slice(60, 360), slice(60, 340))
    plain = painted["food_1"][inside]
    one, everybody = (
        int((np.abs(painted[robot][inside] - plain).sum(-1) > 60).sum())
        for robot in ("medical_0", "all")
    )
    assert 100 < one < everybody


@pytest.mark.long
def test_arrows_of_the_actor_are_drawn_where_they_are_asked_for() -> None:
    record = watched(SHORT, actor_heads=2)
    given: list[Whose | None] = [None, "critic", "actor"]
    default, critic, actor = (
        frames(moving_picture([record], ["a"], ".gif", episode=0, robot="all", attention=whose))[0]
        for whose in given
    )
    assert (default == critic).all()
    inside = (slice(60, 360), slice(60, 340))
    assert (np.abs(actor[inside] - critic[inside]).sum(-1) > 60).sum() > 100
    alone = replace(record, steps={k: v for k, v in record.steps.items() if k != "attention"})
    only = frames(moving_picture([alone], ["a"], ".gif", episode=0, robot="all"))[0]
    assert (only == actor).all()


@pytest.mark.long
def test_a_video() -> None:
    data = moving_picture([watched(SHORT, episodes=1)], ["a"], ".mp4")
    assert data[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"episode": 9}, "--episode 9: must be 0 to 5"),
        ({"attention": "actor"}, "--attention actor: no policy has any that was recorded"),
        ({"robot": "nobody"}, "--robot nobody: must be all, or one of food_0, food_1"),
    ],
)
def test_what_was_not_recorded(options: dict[str, object], message: str) -> None:
    with pytest.raises(RunError, match=message):
        moving_picture([watched(SHORT)], ["a"], ".gif", **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("library", "suffix", "message"),
    [
        ("imageio_ffmpeg", ".mp4", "needs imageio-ffmpeg: pip install 'innerattn\\[report\\]'"),
        ("matplotlib.figure", ".gif", "needs matplotlib: pip install 'innerattn\\[report\\]'"),
    ],
)
def test_a_missing_library_is_named(
    monkeypatch: pytest.MonkeyPatch, library: str, suffix: str, message: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingLibraryError, match=message):
        moving_picture([watched(SHORT, episodes=1)], ["a"], suffix)
