"""The frame that a team trained with `network.symmetry = "canonical"` sees and acts in, in numpy.

An element of the group is a number 0 to 7: bit 0 mirrors x, bit 1 mirrors y, and bit 2 then swaps
x and y. The frame of an observation is the element that brings its first anchor to x >= y >= 0;
where that leaves the choice open, the next anchors decide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.contract import FrameColumns

_ELEMENTS = 8
SWAPPED = [1, 0, 3, 2]
"""Outputs of a policy over vectors in their order once x and y are swapped."""


class Frame:
    """Turns observations into their frames, and what a policy says there back.

    Attributes:
        signs: (8, D) float32, signs of the columns before they are swapped.
        swapped: (D,) int64, the columns in their order once x and y are swapped.
        forward: (8, A) int64, what each action of the world is called in the frame; None where
            actions are vectors.
        mirrors: (8, 4) float32, signs of the outputs of a policy over vectors.
        x: (K,) int64, columns of the anchors' x, the most important first.
        y: (K,) int64, those of their y.
        importance: (K,) float64, each more than the sum of all later ones.
    """

    def __init__(
        self, columns: FrameColumns, width: int, pushes: list[tuple[int, int]] | None
    ) -> None:
        """Make the tables.

        Args:
            columns: what turns.
            width: D.
            pushes: direction of each of the A actions; None: actions are vectors.

        Raises:
            ValueError: a column is not one of the observation, or the actions do not turn into each
                other.
        """
        named = [column for pair in (*columns.vectors, *columns.anchors) for column in pair]
        if not all(0 <= column < width for column in (*named, *columns.handed)):
            raise ValueError(f"network.frame: columns must be 0 to {width - 1}")
        self.signs = np.ones((_ELEMENTS, width), np.float32)
        self.swapped = np.arange(width)
        for x, y in columns.vectors:
            self.signs[[1, 3, 5, 7], x] = -1.0
            self.signs[[2, 3, 6, 7], y] = -1.0
            self.swapped[x], self.swapped[y] = y, x
        for element in range(_ELEMENTS):
            self.signs[element, list(columns.handed)] = (-1.0) ** element.bit_count()
        self.forward = None if pushes is None else _turned_actions(pushes)
        signs = [_turned(element & 3, 1, 1) for element in range(_ELEMENTS)]
        self.mirrors = np.array([(x, y, 1, 1) for x, y in signs], np.float32)
        self.x = np.array([x for x, _ in columns.anchors])
        self.y = np.array([y for _, y in columns.anchors])
        self.importance = 2.0 ** np.arange(len(columns.anchors) - 1, -1, -1)

    def elements(self, rows: NDArray[np.float32]) -> NDArray[np.int64]:
        """The elements (B,) that bring observations (B, D) into their frames."""
        if len(rows) == 1:  # a robot asks for one, and most often the first anchor decides
            first_x, first_y = float(rows[0, self.x[0]]), float(rows[0, self.y[0]])
            if first_x != 0.0 and first_y != 0.0 and abs(first_x) != abs(first_y):
                swap = abs(first_x) < abs(first_y)
                return np.array([(first_x < 0.0) + 2 * (first_y < 0.0) + 4 * swap])
        x, y = rows[:, self.x], rows[:, self.y]
        mirror_x, mirror_y = self._negative(x), self._negative(y)
        x = np.where(mirror_x[:, None], -x, x)
        y = np.where(mirror_y[:, None], -y, y)
        return mirror_x + 2 * mirror_y + 4 * self._negative(x - y)

    def turn(self, rows: NDArray[np.float32], elements: NDArray[np.int64]) -> NDArray[np.float32]:
        """Observations (B, D) of worlds turned by elements (B,)."""
        turned = rows * self.signs[elements]
        swaps = elements >= 4
        turned[swaps] = turned[swaps][:, self.swapped]
        return turned

    def turn_back(
        self, logits: NDArray[np.float32], elements: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Outputs (B, O) for the world's actions from those in the frame: `Contract.outputs`."""
        if self.forward is None:
            swaps = elements >= 4
            back = logits.copy()
            back[swaps] = logits[swaps][:, SWAPPED]
            return np.asarray(back * self.mirrors[elements])
        return np.asarray(logits[np.arange(len(logits))[:, None], self.forward[elements]])

    def _negative(self, values: NDArray[np.float32]) -> NDArray[np.int64]:
        """Whether the first of (B, K) values that is not zero is negative: 1 or 0."""
        return np.asarray(np.sign(values) @ self.importance < 0, np.int64)


def _turned_actions(pushes: list[tuple[int, int]]) -> NDArray[np.int64]:
    """(8, A): what each action of the world is called in the frame of each element.

    Raises:
        ValueError: the actions do not turn into each other.
    """
    turned = [[_turned(element, *push) for push in pushes] for element in range(_ELEMENTS)]
    if any(set(row) != set(pushes) for row in turned):
        raise ValueError("actions: must turn into each other, as the frame needs")
    return np.array([[pushes.index(push) for push in row] for row in turned])


def _turned(element: int, x: int, y: int) -> tuple[int, int]:
    x, y = (-x if element & 1 else x), (-y if element & 2 else y)
    return (y, x) if element & 4 else (x, y)
