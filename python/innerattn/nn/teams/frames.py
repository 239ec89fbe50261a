"""Frames of single vectors: the eight turns and mirrors of the square, applied to pairs (x, y).

A frame is an element of `innerattn.nn.symmetry`: bit 0 mirrors x, bit 1 mirrors y, and bit 2 then
swaps x and y.
"""

from __future__ import annotations

import torch
from torch import Tensor


def frame_of(vectors: Tensor) -> Tensor:
    """The frames (P,) int64 that bring vectors (P, 2) to x >= y >= 0."""
    negative = vectors < 0.0
    swaps = vectors[:, 1].abs() > vectors[:, 0].abs()
    return negative[:, 0].long() + 2 * negative[:, 1].long() + 4 * swaps.long()


def turn(vectors: Tensor, frames: Tensor) -> Tensor:
    """Vectors (P, 2) in their frames (P,)."""
    bits = frames[:, None] >> torch.arange(2) & 1
    mirrored = vectors * (1 - 2 * bits)
    return torch.where((frames >= 4)[:, None], mirrored.flip(-1), mirrored)


def turn_back_choices(choices: Tensor, frames: Tensor) -> Tensor:
    """Numbers for each action in a frame, as those of the actions in the world.

    Args:
        choices: (P, 5) for stay, +x, -x, +y, -y as the frame sees them.
        frames: (P,) int64.
    """
    stay, *sides = choices.unbind(1)
    right, left, up, down = sides
    swap = frames >= 4
    right, up = torch.where(swap, up, right), torch.where(swap, right, up)
    left, down = torch.where(swap, down, left), torch.where(swap, left, down)
    mirror_x, mirror_y = (frames & 1) > 0, (frames & 2) > 0
    return torch.stack(
        [
            stay,
            torch.where(mirror_x, left, right),
            torch.where(mirror_x, right, left),
            torch.where(mirror_y, down, up),
            torch.where(mirror_y, up, down),
        ],
        1,
    )
