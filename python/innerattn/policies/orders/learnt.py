"""Orders of the tasks of an instance as a learnt policy makes them, task by task."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from innerattn import _core
from innerattn.config.instances import Instance
from innerattn.config.untrusted import read_plain
from innerattn.errors import RunError
from innerattn.policies.exported.tensors import tensors_in
from innerattn.policies.orders.network import PlainOrderNetwork
from innerattn.policies.orders.relations import relations_of

SHIPPED = "ral.safetensors"
"""The policy that comes with the package, for instances like those of the set ``ral``."""
_MOST_BYTES = 1 << 26


@cache
def shipped_network() -> PlainOrderNetwork:
    """The policy that comes with the package."""
    return PlainOrderNetwork(tensors_in((files(__package__) / SHIPPED).read_bytes()))


def read_network(path: Path) -> PlainOrderNetwork:
    """A policy from a file of `innerattn.train.orders`.

    Raises:
        RunError: there is no such file, or it holds something else; the message names it.
    """
    data = read_plain(path, _MOST_BYTES)
    try:
        return PlainOrderNetwork(tensors_in(data))
    except (ValueError, RunError) as error:
        raise RunError(f"{path}: no policy for instances: {error}") from error


def learnt_order(
    instance: Instance, network: PlainOrderNetwork, samples: int = 1, seed: int = 0
) -> list[int]:
    """The order of the tasks with the least makespan of those that a policy makes.

    The first always takes the task with the highest score; the others draw tasks by the softmax of
    the scores.

    Args:
        instance: the robots and tasks.
        network: the policy.
        samples: how many orders, at least 1.
        seed: of the draws.
    """
    draws = np.random.default_rng(seed)
    orders = _core.Orders([instance.compiled()] * samples)
    count = len(instance.tasks)
    relations = np.broadcast_to(relations_of(instance), (samples, count, count, 2))
    is_open = np.ones((samples, count), bool)
    for _ in range(count):
        scores = network.scores(orders.features(), relations, is_open)
        scores[1:] += draws.gumbel(size=scores[1:].shape)
        chosen = scores.argmax(axis=1)
        is_open[np.arange(samples), chosen] = False
        orders.take(chosen)
    return orders.orders()[int(orders.makespans().argmin())]
