"""REINFORCE (Williams 1992) over orders of tasks, beside other orders of the same instance.

Of each instance several orders are drawn. The advantage of one is how much shorter its makespan is
than their mean (a shared baseline, Kool et al. 2019; Kwon et al. 2020).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn import _core
from innerattn.nn.orders import OrderNetwork

STEPS_AT_ONCE = 5
"""Tasks of all orders that are in one piece of a gradient; more take more memory."""
MOST_NORM = 1.0
"""Of a gradient."""


@dataclass(frozen=True)
class DrawnOrders:
    """How B orders of up to T tasks were made.

    Attributes:
        features: float32 (T, B, T, F), before each task.
        is_open: bool (T, B, T), which tasks could come next then.
        tasks: int64 (T, B), which did; -1 where all were in the order.
        makespans: float64 (B).
    """

    features: Tensor
    is_open: Tensor
    tasks: Tensor
    makespans: NDArray[np.float64]


@torch.no_grad()
def draw_orders(
    network: OrderNetwork,
    orders: _core.Orders,
    relations: Tensor,
    is_open: Tensor,
    draws: torch.Generator | None,
) -> DrawnOrders:
    """Let a network make orders.

    Args:
        network: that scores tasks.
        orders: without any task yet.
        relations: float32 (B, T, T, 2) of `relations_of`.
        is_open: bool (B, T), which tasks there are.
        draws: where tasks are drawn from; None: the one with the highest score is taken.
    """
    steps: list[tuple[Tensor, Tensor, Tensor]] = []
    for _ in range(is_open.shape[1]):
        features = torch.from_numpy(orders.features())
        scores = network(features, relations, is_open)
        if draws is not None:
            scores -= torch.empty_like(scores).exponential_(generator=draws).log_()
        chosen = scores.argmax(dim=1).where(is_open.any(dim=1), -1)
        orders.take(chosen.numpy())
        steps.append((features, is_open, chosen))
        is_open = is_open.scatter(1, chosen.clamp(min=0)[:, None], value=False)
    features, was_open, tasks = (torch.stack(parts) for parts in zip(*steps, strict=True))
    return DrawnOrders(features, was_open, tasks, orders.makespans())


def reinforce(
    network: OrderNetwork,
    optimizer: torch.optim.Optimizer,
    drawn: DrawnOrders,
    relations: Tensor,
    samples: int,
) -> None:
    """One step of the network towards the shorter orders.

    Args:
        network: that made them.
        optimizer: of its parameters.
        drawn: orders, ``samples`` of each instance side by side.
        relations: as they were made with.
        samples: how many orders there are of each instance.
    """
    makespans = torch.from_numpy(drawn.makespans).float().view(-1, samples)
    gains = makespans.mean(dim=1, keepdim=True) - makespans
    gains = (gains / gains.square().mean().sqrt().clamp(min=1e-6)).flatten()
    count = (drawn.tasks >= 0).sum()
    optimizer.zero_grad()
    for first in range(0, len(drawn.tasks), STEPS_AT_ONCE):
        piece = slice(first, first + STEPS_AT_ONCE)
        features, is_open, tasks = drawn.features[piece], drawn.is_open[piece], drawn.tasks[piece]
        steps = len(features)
        scores = network(
            features.flatten(0, 1), relations.repeat(steps, 1, 1, 1), is_open.flatten(0, 1)
        )
        chosen = tasks.flatten()
        taken = scores.log_softmax(dim=1).gather(1, chosen.clamp(min=0)[:, None]).squeeze(1)
        weights = gains.repeat(steps) * (chosen >= 0)
        (-(taken * weights).sum() / count).backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), MOST_NORM)
    optimizer.step()
