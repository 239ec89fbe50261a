"""What each action is worth on the way to a place, by the law of motion of the worlds."""

from __future__ import annotations

import torch
from torch import Tensor

GAINS_WIDTH = 9
_DIRECTIONS = torch.tensor([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
_SHARPNESS = 20.0


def gains(ways: Tensor, velocities: Tensor, bodies: Tensor) -> Tensor:
    """How much nearer +x, -x, +y and -y bring robots than none does, and which of all is best.

    A robot acts for a control period and then coasts for one, as in
    `innerattn.policies.scripted.steering.Steering.actions`. The unit is what a push changes.

    Args:
        ways: (P, 2) to the place [m].
        velocities: (P, 2) [m/s], in the same frame.
        bodies: (P, 6) as of `TeamTables`.

    Returns:
        (P, GAINS_WIDTH): gains of four actions, and a softmax over all five.
    """
    push, kept, limit, reach = bodies[:, 2:, None].unbind(1)
    moving = (kept * velocities)[:, None] + push[..., None] * _DIRECTIONS
    limit = limit.clamp(min=1e-6)
    factor = reach * limit / torch.maximum(moving.norm(dim=-1), limit)
    left = (ways[:, None] - factor[..., None] * moving).norm(dim=-1)
    # A limit of speeds brings no two moves further apart, so that gains lie in -2..=2.
    found = (left[:, :1] - left) / (torch.minimum(push, limit) * reach).clamp(min=1e-6)
    return torch.cat([found[:, 1:], (_SHARPNESS * found).softmax(1)], 1)
