"""Names beside their points: clear of each other, of marks and of the edge where there is room."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from innerattn.report.plots.names import place_names

GAP_PT = 6.0


def placed(
    points: list[tuple[float, float]], marks: list[tuple[float, float, float, float]]
) -> tuple[list[Annotation], Bbox, list[Bbox]]:
    """Names of points in a square from 0 to 1, after they were placed; its box and the marks'."""
    figure = Figure(figsize=(3.0, 3.0))
    panel = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    panel.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    names = [
        panel.annotate(f"robot_{i}", point, (0, 0), textcoords="offset points", fontsize=6)
        for i, point in enumerate(points)
    ]
    inside = Bbox(panel.transData.transform([(0.0, 0.0), (1.0, 1.0)]))
    boxes = [Bbox(panel.transData.transform([mark[:2], mark[2:]])) for mark in marks]
    place_names([(name, GAP_PT) for name in names], inside, boxes)
    return names, inside, boxes


def covers(one: Bbox, other: Bbox) -> bool:
    shared = Bbox.intersection(one, other)
    return shared is not None and shared.width > 0.0 and shared.height > 0.0


@pytest.mark.parametrize(
    "points",
    [
        [(0.5, 0.5)] * 4,
        [(0.02, 0.02), (0.98, 0.02), (0.02, 0.98), (0.98, 0.98)],
        [(0.99, 0.5), (0.97, 0.52), (0.5, 0.99)],
    ],
)
def test_names_stay_inside_and_apart(points: list[tuple[float, float]]) -> None:
    names, inside, _ = placed(points, [])
    boxes = [name.get_window_extent() for name in names]
    assert not any(covers(one, other) for one, other in combinations(boxes, 2))
    for box in boxes:
        assert inside.x0 <= box.x0 < box.x1 <= inside.x1
        assert inside.y0 <= box.y0 < box.y1 <= inside.y1


def test_alone_a_name_stands_to_the_right() -> None:
    (name,), _, _ = placed([(0.5, 0.5)], [])
    assert name.xyann == (GAP_PT, 0.0)
    assert (name.get_ha(), name.get_va()) == ("left", "center")


def test_marks_stay_clear() -> None:
    beside = [(0.53, 0.48, 1.0, 1.0), (0.0, 0.48, 0.47, 1.0), (0.0, 0.53, 1.0, 1.0)]
    (name,), _, boxes = placed([(0.5, 0.5)], beside)
    assert not any(covers(name.get_window_extent(), box) for box in boxes)
    assert name.xyann == (0.0, -GAP_PT)


def test_a_name_is_as_far_as_asked_on_every_side() -> None:
    names, _, _ = placed([(0.5, 0.5)] * 8, [])
    assert [np.hypot(*name.xyann) for name in names] == pytest.approx([GAP_PT] * 8)
    assert len({name.xyann for name in names}) == 8
