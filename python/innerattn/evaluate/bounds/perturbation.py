"""Changes of robots' inputs: drawn at random, or sought so that attention logits move far.

Pure functions of tensors; whose encodings they change is not known here.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor


def rms_norm(x: Tensor) -> Tensor:
    """(R,) root of the mean square norm of (R, B, X) over B."""
    return x.square().sum(2).mean(1).sqrt()


def random_directions(shape: tuple[int, ...], generator: torch.Generator) -> Tensor:
    """Vectors of length 1 along the last dimension, evenly spread over directions; float64."""
    drawn = torch.randn(shape, generator=generator, dtype=torch.float64)
    return _unit(drawn)


def strongest_change(
    encode: Callable[[Tensor], Tensor],
    inputs: Tensor,
    directions: Tensor,
    drawn: Tensor,
    steps: int,
) -> Tensor:
    """Changes of each robot's input that move given logits far, by projected gradient ascent.

    For robot j, other robot o, head h and state b it climbs |g . (encode(x + c) - encode(x))| over
    the changes c that are no longer than the drawn ones. It starts from the best of these, takes
    steps as long as the radius and keeps the best point: none of the drawn ones is stronger.

    Args:
        encode: maps each robot's inputs (R, N, X) to its encodings (R, N, W).
        inputs: (R, B, X) x.
        directions: (R, H, B, W) g of each other robot, as `LogitSlopes` has them.
        drawn: (R, K, B, X) changes of robot j, all of one length for each j.
        steps: how many steps to take.

    Returns:
        (R, R * H, B, X) changes of robot j; entry o * H + h aims at other robot o and head h.
    """
    robots, _, batch, width = directions.shape
    before = encode(inputs).unsqueeze(1)
    x = inputs.unsqueeze(1)

    def encoded(change: Tensor) -> Tensor:
        return encode((x + change).flatten(1, 2)).view(robots, -1, batch, width) - before

    with torch.no_grad():
        reached = torch.einsum("jkbw,ohbw->johbk", encoded(drawn), directions).abs()
        best_draw = reached.argmax(-1).flatten(1, 2)  # (R, R * H, B)
        index = best_draw.unsqueeze(3).expand(-1, -1, -1, inputs.shape[2])
        best = drawn.gather(1, index)
        radius = drawn.norm(dim=3).amax((1, 2)).view(-1, 1, 1, 1)
    goals = directions.flatten(0, 1)
    highest = torch.full(best.shape[:3], -1.0, dtype=best.dtype)
    change = best
    for step in range(steps + 1):
        change = change.detach().requires_grad_()
        height = (goals * encoded(change)).sum(3).abs()
        better = (height > highest).detach()
        highest = torch.where(better, height.detach(), highest)
        best = torch.where(better.unsqueeze(3), change.detach(), best)
        if step == steps:
            break
        (slope,) = torch.autograd.grad(height.sum(), change)
        with torch.no_grad():
            change = change + radius * _unit(slope)
            change = change * (radius / change.norm(dim=3, keepdim=True)).clamp_max(1.0)
    return best


def _unit(x: Tensor) -> Tensor:
    """Vectors along the last dimension at length 1; zero stays zero."""
    length: Tensor = x.norm(dim=-1, keepdim=True)
    return x / length.clamp_min(torch.finfo(x.dtype).tiny)
