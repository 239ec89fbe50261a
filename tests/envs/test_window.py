"""`render_mode="human"`: a window that reset and step keep up to date, or a clear refusal."""

from collections.abc import Iterator

import numpy as np
import pytest
from fake_window import FigureCanvas
from matplotlib import pyplot as plt

from innerattn.envs import parallel_env

STEP = {"food_0": 1, "food_1": 2, "navigation_0": 3, "medical_0": 4}


@pytest.fixture
def windows() -> Iterator[list[float]]:
    """Seconds waited for each frame, where windows can be opened."""
    before = plt.get_backend()
    plt.switch_backend("module://fake_window")
    FigureCanvas.waited.clear()
    yield FigureCanvas.waited
    plt.close("all")
    plt.switch_backend(before)


def seen() -> np.ndarray:
    return np.asarray(plt.gcf().canvas.buffer_rgba()).copy()  # type: ignore[attr-defined]


def test_reset_and_step_show_the_world(windows: list[float]) -> None:
    env = parallel_env(render_mode="human", seed=0)
    assert not windows
    env.reset()
    assert plt.get_figlabels() == ["innerattn, mixed"]
    first = seen()
    env.step(STEP)
    second = seen()
    assert (first != second).any()
    assert len(windows) == 2
    assert env.render() is None
    assert len(windows) == 3
    assert (seen() == second).all()
    env.close()
    assert not plt.get_fignums()


def test_it_shows_what_a_picture_shows(windows: list[float]) -> None:
    env, other = parallel_env(render_mode="human", seed=0), parallel_env(seed=0)
    pictures = parallel_env(render_mode="rgb_array", seed=0)
    for one in (env, other, pictures):
        one.reset()
        one.step(STEP)
    assert np.array_equal(env.state(), other.state()), "to be seen changes nothing"
    plt.gcf().set_dpi(100)
    plt.gcf().canvas.draw()
    assert (seen()[..., :3] == pictures.render()).all()
    assert windows


def test_frames_come_no_faster_than_they_should(
    windows: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr("innerattn.envs.window.time.monotonic", lambda: now[0])
    env = parallel_env(render_mode="human", seed=0)
    assert env.metadata["render_fps"] == 10
    env.reset()
    env.step(STEP)  # at once: must wait for its turn
    now[0] += 0.14
    env.step(STEP)
    now[0] += 5.0  # late: nothing to wait for
    env.step(STEP)
    assert windows == pytest.approx([0.001, 0.1, 0.06, 0.001])


def test_a_window_that_was_closed_stays_closed(windows: list[float]) -> None:
    env = parallel_env(render_mode="human", seed=0)
    env.reset()
    plt.close("all")
    env.step(STEP)
    assert env.render() is None
    assert len(windows) == 1
    assert not plt.get_fignums()
    env.close()


def test_without_a_display_it_says_so_once(capsys: pytest.CaptureFixture[str]) -> None:
    before = plt.get_backend()
    plt.switch_backend("agg")
    env = parallel_env(render_mode="human", seed=0)
    env.reset()
    env.step(STEP)
    assert env.render() is None
    assert not plt.get_fignums()
    env.close()
    plt.switch_backend(before)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("innerattn: render_mode = 'human': no window can be opened")
    assert line.endswith("'rgb_array' gives pictures")
