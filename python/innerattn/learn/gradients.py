"""What is done with gradients between a loss and Adam: averaging over robots, and clipping.

Everything here changes the gradients in place. Gradients of parameters by robot have robots first,
(R, ...), or kinds where robots of a kind share parameters, (K, ...).
"""

from __future__ import annotations

import torch
from torch import Tensor

from innerattn.learn.adam import Gradients
from innerattn.nn import is_shared_by_kind

_UNROLLED = 8
"""Norms that are summed at a time. Torch's compiler (2.15) writes so short a sum out; of a longer
one it makes a loop, which it then fails to fuse with Adam."""


def average_over_robots(
    gradients: Gradients, num_robots: int, robots_of_each_kind: Tensor | None
) -> None:
    """Divide gradients of what robots share by the number of these robots, before clipping.

    A loss is a sum over robots, and so is the gradient of what they share. MAAC's code divides that
    of the attention, which all robots share, and also those of each robot's state-action encoder.

    Args:
        gradients: By name; a critic's attention is called "attention".
        num_robots: R.
        robots_of_each_kind: (K,), to divide gradients of layers shared by kind (K, ...), too; None:
            these stay sums.
    """
    attention = [gradient for name, gradient in gradients.items() if name.startswith("attention.")]
    if attention:
        torch._foreach_div_(attention, num_robots)
    if robots_of_each_kind is not None:
        for name, gradient in gradients.items():
            if is_shared_by_kind(name):
                gradient.div_(robots_of_each_kind.view(-1, *[1] * (gradient.dim() - 1)))


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
