"""Learning curves: two panels for each situation, a line for each method, scripts beside them."""

import numpy as np
import pytest

from innerattn.report.plots.curves import draw_curves
from innerattn.stats.seeds import SeedCurve
from innerattn.studies.curves import LearningCurve


def line(situation: str, method: str, *, band: bool = True) -> LearningCurve:
    steps = np.linspace(1_000, 4_000, 4)
    mean = np.arange(4.0)
    half = np.ones(4) if band else np.full(4, np.nan)
    rescues = SeedCurve("student", mean, mean - half, mean + half, np.full(4, 3))
    scripts = {"greedy": 2.5}
    return LearningCurve(situation, method, steps, steps / 10.0, rescues, "episode", scripts)


@pytest.mark.parametrize("band", [True, False])
def test_lines_bands_and_scripts(band: bool) -> None:
    lines = [
        line(situation, method, band=band)
        for situation, method in (("mixed", "a"), ("single", "a"), ("mixed", "b"))
    ]
    figure = draw_curves(lines)
    mixed, single, mixed_by_time, _ = figure.axes
    assert [panel.get_title() for panel in figure.axes] == ["mixed", "single", "", ""]
    assert mixed.get_ylabel() == "rescues per episode of training"
    drawn = {one.get_label(): one for one in mixed.get_lines() if one.get_label() in "ab"}
    assert sorted(drawn) == ["a", "b"]
    assert drawn["a"].get_xdata().tolist() == [1.0, 2.0, 3.0, 4.0]
    assert drawn["a"].get_ydata().tolist() == [0.0, 1.0, 2.0, 3.0]
    (timed,) = [one for one in mixed_by_time.get_lines() if one.get_label() == "a"]
    assert timed.get_xdata() == pytest.approx(np.array([100.0, 200.0, 300.0, 400.0]) / 60.0)
    assert timed.get_ydata().tolist() == drawn["a"].get_ydata().tolist()
    (alone,) = [one for one in single.get_lines() if one.get_label() == "a"]
    assert alone.get_color() == drawn["a"].get_color() != drawn["b"].get_color()
    for panel in figure.axes:
        assert [text.get_text() for text in panel.texts] == ["greedy"]
        assert panel.get_ylim()[0] == 0.0
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a", "b"]
