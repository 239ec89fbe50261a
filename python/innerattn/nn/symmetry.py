"""The eight symmetries of the square world, acting on observations and on actions.

An element of the group is a number 0 to 7: bit 0 mirrors x, bit 1 mirrors y, and bit 2 then swaps
x and y. Everything here moves columns, changes signs and looks up actions: turning there and back
is exact to the bit. Actions of robots on wheels do not turn with the world: where it is mirrored,
they change left and right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

NUM_ELEMENTS = 8
_ACTIONS = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
"""What the discrete actions of a world push to: stay, +x, -x, +y, -y."""
_MIRRORED = (0, 1, 2, 4, 3)
"""What stop, forward, backward, left and right of robots on wheels are in a mirrored world."""


@dataclass(frozen=True)
class VectorColumns:
    """Which columns of an observation turn with the world.

    Attributes:
        width: D, columns of a whole observation.
        vectors: Columns (x, y) of every vector.
        handed: Columns that change their sign in a mirrored world, such as angles.
        anchors: Those of `vectors` that choose the frame, the most important first.
        rays: Columns of rays, K of them, which change places.
        ray_turns: For each element of the group, the K rays whose readings take the places of
            the rays in the turned world.
    """

    width: int
    vectors: tuple[tuple[int, int], ...]
    handed: tuple[int, ...]
    anchors: tuple[tuple[int, int], ...]
    rays: tuple[int, ...] = ()
    ray_turns: tuple[tuple[int, ...], ...] = ()


class SquareSymmetry:
    """The group of the square for one layout of observations.

    The frame of an observation is the element that brings its first anchor (x, y) to x >= y >= 0.
    Where an anchor leaves the choice open (it is zero, or lies on an axis or on a diagonal), the
    next ones decide. An observation from a turned world therefore has the same form in its frame.
    """

    def __init__(
        self, columns: VectorColumns, device: torch.device, drives: Sequence[str] = ()
    ) -> None:
        """Prepare the tables of signs, columns and actions on ``device``.

        Args:
            columns: Which columns turn.
            device: Where.
            drives: What actions set of each robot, as `Robot.drive` says; none: directions in the
                plane. With them, the last axis of actions is that of the robots.

        Raises:
            ValueError: There is no anchor, a column is not one of the observation, or it is not
                said how rays turn.
        """
        named = [column for vector in columns.vectors for column in vector]
        named += [*columns.handed, *columns.rays]
        if not columns.anchors or not all(0 <= column < columns.width for column in named):
            raise ValueError(
                f"columns = {columns}: needs an anchor, and columns in 0..{columns.width - 1}"
            )
        if [len(turn) for turn in columns.ray_turns] != [len(columns.rays)] * (
            NUM_ELEMENTS if columns.rays else 0
        ):
            raise ValueError(f"columns = {columns}: needs a turn of all rays for each element")
        signs = torch.ones(NUM_ELEMENTS, columns.width)
        swapped = torch.arange(columns.width)
        for x, y in columns.vectors:
            signs[1::2, x] = -1.0
            signs[[2, 3, 6, 7], y] = -1.0
            swapped[x], swapped[y] = y, x
        # A mirror, and a swap, turn left into right; two of them do not.
        odd = torch.tensor([element.bit_count() % 2 == 1 for element in range(NUM_ELEMENTS)])
        signs[:, list(columns.handed)] = (1.0 - 2.0 * odd.float()).unsqueeze(1)
        self._odd = odd.to(device)
        self._unicycle, self._differential = (
            torch.tensor([drive == name for drive in drives], dtype=torch.bool, device=device)
            for name in ("unicycle", "differential")
        )
        self._has_wheels = bool((self._unicycle | self._differential).any())
        self._left_right = torch.tensor([range(5), _MIRRORED], device=device)
        self._signs, self._swapped = signs.to(device), swapped.to(device)
        self._rays = torch.tensor(columns.rays, dtype=torch.int64, device=device)
        self._ray_turns = torch.tensor(columns.ray_turns, dtype=torch.int64, device=device)
        self._anchors = columns.anchors
        powers = range(len(columns.anchors) - 1, -1, -1)
        self._importance = torch.tensor([2.0**k for k in powers], dtype=torch.float64).to(device)
        forward = torch.tensor(
            [[_ACTIONS.index(_turned(element, *push)) for push in _ACTIONS] for element in range(8)]
        )
        self._forward = forward.to(device)
        self._back = forward.argsort(dim=1).to(device)
        mirrors = [_turned(element & 3, 1, 1) for element in range(NUM_ELEMENTS)]
        self._mirrors = torch.tensor(mirrors, dtype=torch.float32).to(device)

    def frame(self, obs: Tensor) -> Tensor:
        """The elements (...) int64 that bring observations (..., D) into their frames."""
        x, y = (obs[..., column] for column in self._anchors[0])
        element = _element(x < 0, y < 0, x.abs() < y.abs())
        open_choice = (x == 0) | (y == 0) | (x.abs() == y.abs())
        if open_choice.any():
            element[open_choice] = self._frame_by_all(obs[open_choice])
        return element

    def _frame_by_all(self, obs: Tensor) -> Tensor:
        """The elements (n,) for observations (n, D), by all anchors."""
        x, y = (obs[:, list(columns)] for columns in zip(*self._anchors, strict=True))
        mirror_x, mirror_y = self._first_sign(x) < 0, self._first_sign(y) < 0
        x = torch.where(mirror_x.unsqueeze(1), -x, x)
        y = torch.where(mirror_y.unsqueeze(1), -y, y)
        return _element(mirror_x, mirror_y, self._first_sign(x - y) < 0)

    def turn(self, obs: Tensor, element: Tensor) -> Tensor:
        """Observations (..., D) of worlds turned by elements (...)."""
        elements = element.flatten()
        signs = self._signs.index_select(0, elements).to(obs.dtype)
        rows = obs.reshape(signs.shape) * signs
        swapped = (elements >= 4).nonzero().squeeze(1)
        # Row by row: to choose between two copies of everything takes four times as long.
        rows.index_copy_(0, swapped, rows[swapped].index_select(1, self._swapped))
        if len(self._rays):
            readings = rows.index_select(1, self._rays).gather(1, self._ray_turns[elements])
            rows.index_copy_(1, self._rays, readings)
        return rows.view(obs.shape)

    def turn_actions(self, actions: Tensor, element: Tensor) -> Tensor:
        """The actions that do in turned worlds what ``actions`` do in these.

        Args:
            actions: (...) int64, or (..., 2) of a floating-point type.
            element: (...) int64.
        """
        if actions.is_floating_point():
            x, y = self._mirrored(actions, element).unbind(-1)
            return self._on_wheels(actions, element, _swapped(x, y, element))
        return self._on_wheels(actions, element, self._forward[element, actions])

    def turn_actions_back(self, actions: Tensor, element: Tensor) -> Tensor:
        """The inverse of `turn_actions`."""
        if actions.is_floating_point():
            x, y = actions.unbind(-1)
            turned = self._mirrored(_swapped(x, y, element), element)
            return self._on_wheels(actions, element, turned)
        return self._on_wheels(actions, element, self._back[element, actions])

    def _on_wheels(self, actions: Tensor, element: Tensor, turned: Tensor) -> Tensor:
        """Turned actions, in which those of robots on wheels are mirrored at most.

        That is its own inverse.
        """
        if not self._has_wheels:
            return turned
        odd = self._odd[element]
        if not actions.is_floating_point():
            mirrored = self._left_right[odd.long(), actions]
            return torch.where(self._unicycle | self._differential, mirrored, turned)
        odd = odd.unsqueeze(-1)
        speed, turn = actions.unbind(-1)
        mirrored = torch.where(odd, torch.stack([speed, -turn], -1), actions)
        turned = torch.where(self._unicycle.unsqueeze(-1), mirrored, turned)
        wheels = torch.where(odd, actions.flip(-1), actions)
        return torch.where(self._differential.unsqueeze(-1), wheels, turned)

    def _mirrored(self, vectors: Tensor, element: Tensor) -> Tensor:
        return vectors * self._mirrors[element].to(vectors.dtype)

    def _first_sign(self, values: Tensor) -> Tensor:
        """A number with the sign of the first of (..., K) values that is not zero, else 0."""
        # The power of an anchor is more than the sum of all later ones.
        return values.sign().double() @ self._importance


def inverse(element: Tensor) -> Tensor:
    """The elements that turn back what ``element`` turns: mirrors change places with a swap."""
    exchanged = (element & 4) + 2 * (element & 1) + ((element >> 1) & 1)
    return torch.where(element >= 4, exchanged, element)


def between(first: Tensor, second: Tensor) -> Tensor:
    """The elements that turn what ``first`` has turned into what ``second`` turns.

    Turning by ``first`` and then by the result is turning by ``second``.
    """
    mirrors = (first ^ second) & 3  # of the world; as ``first`` has it, a swap exchanges them
    exchanged = ((mirrors & 1) << 1) + (mirrors >> 1)
    return torch.where(first >= 4, exchanged, mirrors) + ((first ^ second) & 4)


def turned_signs(element: Tensor) -> tuple[Tensor, Tensor]:
    """Signs, 1 or -1, of the first and the second part of a vector that elements (...) turn."""
    x, y = 1 - 2 * (element & 1), 1 - (element & 2)
    swap = element >= 4
    return torch.where(swap, y, x), torch.where(swap, x, y)


def _element(mirror_x: Tensor, mirror_y: Tensor, swap: Tensor) -> Tensor:
    return mirror_x.long() + 2 * mirror_y.long() + 4 * swap.long()


def _swapped(x: Tensor, y: Tensor, element: Tensor) -> Tensor:
    """Vectors (..., 2) of their parts (...), which swap where the element says so."""
    swap = element >= 4
    return torch.stack([torch.where(swap, y, x), torch.where(swap, x, y)], dim=-1)


def _turned(element: int, x: int, y: int) -> tuple[int, int]:
    x, y = (-x if element & 1 else x), (-y if element & 2 else y)
    return (y, x) if element & 4 else (x, y)
