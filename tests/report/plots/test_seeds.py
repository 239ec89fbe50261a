"""The figure of seeds: each run is a dot in the column of its seed."""

import numpy as np

from innerattn.report.plots.seeds import SeedPanel, draw_seeds


def test_every_run_is_a_dot_within_the_bar_of_its_seed() -> None:
    arms = {"uniform": {0: 0.5, 3: 0.7}, "inner": {3: 0.4, 0: 0.6, 7: 0.55}}
    others = {name: {1: 0.5} for name in arms}
    figure = draw_seeds([[SeedPanel("a", arms), SeedPanel("b", others)]])
    panel, other = figure.axes
    assert (panel.get_title(), other.get_title()) == ("a", "b")
    assert [text.get_text() for text in panel.get_xticklabels()] == ["0", "3", "7"]
    dots = [line for line in panel.lines if line.get_marker() in "so^v"]
    drawn = {
        (line.get_label(), round(float(x)), float(y))
        for line in dots
        for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)
    }
    places = {0: 0, 3: 1, 7: 2}
    assert {(place, value) for _, place, value in drawn} == {
        (places[seed], value) for arm in arms.values() for seed, value in arm.items()
    }
    bars = {(bar.get_y(), bar.get_y() + bar.get_height()) for bar in panel.patches}
    assert np.allclose(sorted(bars), [(0.4, 0.7), (0.5, 0.6), (0.55, 0.55)])
    low, high = panel.get_ylim()
    assert np.isclose(high - 0.5, 0.5 - low)
    assert high > 0.7
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.texts] == ["uniform", "inner"]


def test_a_panel_without_runs_is_empty() -> None:
    figure = draw_seeds([[SeedPanel("none", {"uniform": {}})]])
    (panel,) = figure.axes
    assert not panel.patches
