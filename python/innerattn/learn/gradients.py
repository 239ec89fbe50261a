"""What is done with gradients between a loss and Adam: averaging over robots, and clipping.

Everything here changes the gradients in place. Gradients of parameters by robot have robots first,
(R, ...), or kinds where robots of a kind share parameters, (K, ...).
"""

from __future__ import annotations

import torch
from torch import Tensor

from innerattn.learn.adam import Gradients

_UNROLLED = 8
"""Norms that are summed at a time. Torch's compiler (2.15) writes so short a sum out; of a longer
one it makes a loop, which it then fails to fuse with Adam."""


def average_over_robots(gradients: Gradients, num_robots: int) -> None:
    """Divide the gradients of the attention, which all robots share, by the number of robots.

    A loss is a sum over robots, so that without this the attention would learn faster the larger
    the team. MAAC's code does the same, also before clipping.
    """
    shared = [gradient for name, gradient in gradients.items() if name.startswith("attention.")]
    if shared:
        torch._foreach_div_(shared, num_robots)


def clip_norm(gradients: Gradients, limit: float) -> Tensor:
    """Scale all gradients down to a common norm of at most ``limit``.

    Returns:
        () the norm before clipping.
    """
    norms = torch._foreach_norm(list(gradients.values()))
    norm: Tensor = torch.linalg.vector_norm(torch.stack(norms))
    # The small number keeps zeros zero; it is that of torch's own clipping.
    torch._foreach_mul_(list(gradients.values()), (limit / (norm + 1e-6)).clamp_max(1.0))
    return norm


def clip_norm_by_robot(gradients: Gradients, limit: float) -> Tensor:
    """Scale each robot's gradient down to a norm of at most ``limit``.

    Returns:
        (R,) the norms before clipping, or (K,) those of kinds.
    """
    per_robot = [
        torch.linalg.vector_norm(gradient.flatten(1), dim=1) for gradient in gradients.values()
    ]
    while len(per_robot) > _UNROLLED:
        per_robot = [
            torch.linalg.vector_norm(torch.stack(per_robot[first : first + _UNROLLED]), dim=0)
            for first in range(0, len(per_robot), _UNROLLED)
        ]
    norms: Tensor = torch.linalg.vector_norm(torch.stack(per_robot), dim=0)
    factors = (limit / (norms + 1e-6)).clamp_max(1.0)
    torch._foreach_mul_(
        list(gradients.values()),
        [factors.view(-1, *[1] * (gradient.dim() - 1)) for gradient in gradients.values()],
    )
    return norms
