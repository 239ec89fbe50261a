"""Places names in a figure beside what they name, clear of each other and of all else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.text import Annotation
    from matplotlib.transforms import BboxBase

# Directions in which a name may stand from its point, the best first.
_SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
_ANCHORS = {-1: ("right", "top"), 0: ("center", "center"), 1: ("left", "bottom")}


def place_names(
    names: Sequence[tuple[Annotation, float]], inside: BboxBase, marks: Sequence[BboxBase]
) -> None:
    """Move each name to that side of its point where it covers least; earlier names choose first.

    The figure must have been laid out.

    Args:
        names: annotations with offsets in points, each with its distance from its point [pt].
        inside: box that they should not leave, in pixels.
        marks: boxes that they should not cover, in pixels.
    """
    taken = list(marks)
    for name, distance in names:
        covered = []
        for side in _SIDES:
            _stand(name, side, distance)
            box = name.get_window_extent()
            outside = box.width * box.height - _shared(box, inside)
            covered.append(outside + sum(_shared(box, other) for other in taken))
        _stand(name, _SIDES[int(np.argmin(covered))], distance)
        taken.append(name.get_window_extent())


def _stand(name: Annotation, side: tuple[int, int], distance: float) -> None:
    right, up = side
    share = distance / np.hypot(right, up)
    name.xyann = (right * share, up * share)
    name.set(ha=_ANCHORS[right][0], va=_ANCHORS[up][1])


def _shared(one: BboxBase, other: BboxBase) -> float:
    """The area that two boxes share [square pixels]."""
    width = min(one.x1, other.x1) - max(one.x0, other.x0)
    height = min(one.y1, other.y1) - max(one.y0, other.y0)
    return float(max(width, 0.0) * max(height, 0.0))
