"""The frame that a team trained with `network.symmetry = "canonical"` sees and acts in, in numpy.

An element of the group is a number 0 to 7: bit 0 mirrors x, bit 1 mirrors y, and bit 2 then swaps
x and y. The frame of an observation is the element that brings its first anchor to x >= y >= 0;
where that leaves the choice open, the next anchors decide. Actions of robots on wheels do not turn
with the world: where it is mirrored, they change left and right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from innerattn.policies.exported.contract import Contract, FrameColumns

_ELEMENTS = 8
_ODD = [bin(element).count("1") % 2 == 1 for element in range(_ELEMENTS)]
"""Which elements turn left into right: one mirror or the swap does, two of them do not."""
_SWAPPED = [1, 0, 3, 2]
"""Outputs of a policy over vectors in their order once both parts are swapped."""
_LEFT_RIGHT = [0, 1, 2, 4, 3]
"""What stop, forward, backward, left and right are in a mirrored world."""


class Frame:
    """Turns observations into their frames, and what a policy says there back.

    Attributes:
        signs: (8, D) float32, signs of the columns before they change places.
        order: (8, D) int64, the columns in their order in the frame.
        forward: (8, A) int64, what each action of the world is called in the frame; None where
            actions are vectors.
        outputs: (8, 4) int64, the outputs of a policy over vectors in their order in the world.
        mirrors: (8, 4) float32, their signs there.
        x: (K,) int64, columns of the anchors' x, the most important first.
        y: (K,) int64, those of their y.
        importance: (K,) float64, each more than the sum of all later ones.
    """

    def __init__(
        self,
        columns: FrameColumns,
        width: int,
        pushes: list[tuple[int, int]] | None,
        drive: str = "force",
    ) -> None:
        """Make the tables.

        Args:
            columns: what turns.
            width: D.
            pushes: direction of each of the A actions; None: actions are vectors.
            drive: what actions set, as `Member.drive`.

        Raises:
            ValueError: a column is not one of the observation, or the actions do not turn into each
                other.
        """
        named = [column for pair in (*columns.vectors, *columns.anchors) for column in pair]
        if not all(0 <= column < width for column in (*named, *columns.handed, *columns.rays)):
            raise ValueError(f"network.frame: columns must be 0 to {width - 1}")
        rays = range(len(columns.rays))
        turns = columns.ray_turns or ((),) * _ELEMENTS
        if len(turns) != _ELEMENTS or any(sorted(turn) != [*rays] for turn in turns):
            raise ValueError("network.frame.ray_turns: must be an order of the rays for each of 8")
        self.signs = np.ones((_ELEMENTS, width), np.float32)
        self.order = np.tile(np.arange(width), (_ELEMENTS, 1))
        for x, y in columns.vectors:
            self.signs[[1, 3, 5, 7], x] = -1.0
            self.signs[[2, 3, 6, 7], y] = -1.0
            self.order[4:, x], self.order[4:, y] = y, x
        self.signs[np.ix_(_ODD, columns.handed)] = -1.0
        for element, turn in enumerate(turns):
            self.order[element, list(columns.rays)] = [columns.rays[ray] for ray in turn]
        self.forward = None if pushes is None else _turned_actions(pushes, drive)
        self.outputs, self.mirrors = _turned_outputs(drive)
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
        return np.asarray(turned[np.arange(len(rows))[:, None], self.order[elements]])

    def turn_back(
        self, logits: NDArray[np.float32], elements: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Outputs (B, O) for the world's actions from those in the frame: `Contract.outputs`."""
        names = self.outputs if self.forward is None else self.forward
        back = logits[np.arange(len(logits))[:, None], names[elements]]
        return np.asarray(back * self.mirrors[elements] if self.forward is None else back)

    def _negative(self, values: NDArray[np.float32]) -> NDArray[np.int64]:
        """Whether the first of (B, K) values that is not zero is negative: 1 or 0."""
        return np.asarray(np.sign(values) @ self.importance < 0, np.int64)


def frame_of(contract: Contract, actor: str) -> Frame | None:
    """The frame that an actor sees in; None where it sees the world as it is.

    Raises:
        ValueError: it does not fit the observation, or robots with unlike drives share the actor.
    """
    if contract.network.frame is None:
        return None
    drives = {robot.drive for robot in contract.robots if robot.actor == actor}
    if len(drives) > 1:
        raise ValueError(f"actors: {actor} is of robots with unlike drives")
    pushes = None
    if contract.action_kind == "discrete":
        pushes = [(int(x), int(y)) for x, y in (action.force for action in contract.actions)]
    return Frame(contract.network.frame, len(contract.observation), pushes, *drives)


def _turned_actions(pushes: list[tuple[int, int]], drive: str) -> NDArray[np.int64]:
    """(8, A): what each action of the world is called in the frame of each element.

    Raises:
        ValueError: the actions do not turn into each other.
    """
    if drive in ("unicycle", "differential"):
        if len(pushes) != len(_LEFT_RIGHT):
            raise ValueError(f"actions: must be {len(_LEFT_RIGHT)} for a robot on wheels")
        return np.array([_LEFT_RIGHT if odd else range(len(_LEFT_RIGHT)) for odd in _ODD])
    turned = [[_turned(element, *push) for push in pushes] for element in range(_ELEMENTS)]
    if any(set(row) != set(pushes) for row in turned):
        raise ValueError("actions: must turn into each other, as the frame needs")
    return np.array([[pushes.index(push) for push in row] for row in turned])


def _turned_outputs(drive: str) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """(8, 4) each: order and signs of means and log standard deviations in the world."""
    as_they_are = [*range(len(_SWAPPED))]
    order = np.array([as_they_are] * _ELEMENTS)
    signs = np.ones((_ELEMENTS, len(_SWAPPED)), np.float32)
    if drive == "unicycle":
        signs[_ODD, 1] = -1.0
    elif drive == "differential":
        order[_ODD] = _SWAPPED
    else:
        order[4:] = _SWAPPED
        signs[:, :2] = [_turned(element & 3, 1, 1) for element in range(_ELEMENTS)]
    return order, signs


def _turned(element: int, x: int, y: int) -> tuple[int, int]:
    x, y = (-x if element & 1 else x), (-y if element & 2 else y)
    return (y, x) if element & 4 else (x, y)
