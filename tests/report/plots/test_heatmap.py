"""Heat maps: what is drawn, that it is the same twice, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from innerattn.config import Scenario
from innerattn.errors import RunError
from innerattn.evaluate.faults.grid import Grid, Retention, Window
from innerattn.report.plots.drawing import check_format
from innerattn.report.plots.heatmap import draw_heatmap, write_heatmap
from innerattn.stats.bootstrap import Resampled

GRID = Grid(Scenario(), kinds=("motor_gain", "blackout"), severities=(0.5, 1.0))


def some_retention() -> Retention:
    value = np.linspace(0, 1.1, 32).reshape(2, 2, 4, 2)
    cells = Resampled(value, value[..., None])
    nothing = Resampled(np.zeros(()), np.zeros(1))
    window = Window(nothing, nothing, nothing)
    return Retention(window, window, window, window, cells, nothing, nothing)


def test_a_panel_for_each_robot_and_onset_with_its_numbers() -> None:
    figure = draw_heatmap("greedy", some_retention(), GRID)
    panels = figure.axes[:8]
    assert [panel.get_title() for panel in panels[:4]] == [
        *("food_0", "food_1", "navigation_0", "medical_0")
    ]
    value = some_retention().cells.value
    for index, panel in enumerate(panels):
        robot, onset = index % 4, index // 4
        texts = [text.get_text() for text in panel.texts]
        assert texts == [f"{x:.2f}" for x in value[:, :, robot, onset].ravel()]


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_the_same_figures_give_the_same_file(tmp_path: Path, suffix: str) -> None:
    files = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for path in files:
        write_heatmap(path, "greedy", some_retention(), GRID)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert sorted(tmp_path.iterdir()) == files


def test_other_kinds_of_files_are_refused() -> None:
    with pytest.raises(RunError, match=r"a.jpeg: the file must end in .pdf, .png, .svg"):
        check_format(Path("a.jpeg"))
