"""Trains a policy for instances of task allocation: which task comes next in an order.

`python -m innerattn.train.orders --out mine.safetensors` draws random instances of the sort of the
set ``ral``; its options say of which sort. `innerattn evaluate learnt:mine.safetensors --instances
FILE` uses the policy. One seed gives the same weights on one machine.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
import tyro
from torch import Tensor

from innerattn import _core
from innerattn.config.instances import Instance
from innerattn.config.instances.draw import InstanceSort, draw_instance
from innerattn.errors import ConfigError, InnerattnError
from innerattn.learn.orders import draw_orders, reinforce
from innerattn.nn.orders import OrderNetwork
from innerattn.policies.orders.relations import RELATIONS, relations_of
from innerattn.policies.scripted.planner import schedule_by
from innerattn.train.weights import write_weights

FORMAT = "innerattn.orders"
"""What the file says that it is."""
MEASURED = 100
"""Random instances on which the policy is measured; it does not train on them."""


@dataclass(frozen=True, kw_only=True)
class OrderTraining:
    """How to train.

    Attributes:
        out: file of the weights.
        sort: random instances to train on.
        updates: steps of the learner.
        instances: random instances of each update.
        samples: orders that are drawn of each of them.
        learning_rate: of Adam at first; it falls to 1 % of that in a straight line.
        width: of hidden layers, a multiple of 4.
        log_every: updates between two measurements.
        seed: of instances, weights and draws.

    Raises:
        ConfigError: a value is out of range.
    """

    out: Path
    sort: InstanceSort = field(default_factory=InstanceSort)
    updates: int = 600
    instances: int = 24
    samples: int = 16
    learning_rate: float = 1.5e-3
    width: int = 64
    log_every: int = 50
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("updates", self.updates, 1, 10_000_000),
            ("instances", self.instances, 1, 10_000),
            ("samples", self.samples, 2, 10_000),
            ("learning_rate", self.learning_rate, 1e-9, 1.0),
            ("width", self.width, 4, 4096),
            ("log_every", self.log_every, 1, 10_000_000),
            ("seed", self.seed, 0, 2**63 - 1),
        ):
            if not low <= value <= high:
                raise ConfigError(f"{name} = {value}: must be {low} to {high}")
        if self.width % 4:
            raise ConfigError(f"width = {self.width}: must be a multiple of 4")


@dataclass(frozen=True)
class Measured:
    """How far a training is.

    Attributes:
        updates: that are done.
        makespan: mean of the policy's likeliest orders, on instances that it does not train on.
        greedy: that of the planner ``greedy`` on them.
        seconds: since the beginning [s].
    """

    updates: int
    makespan: float
    greedy: float
    seconds: float


def train_orders(
    training: OrderTraining, told: Callable[[Measured], None] | None = None
) -> OrderNetwork:
    """Train a network and write its weights.

    Args:
        training: how.
        told: is called after each measurement.

    Raises:
        OSError: the file cannot be written.
    """
    began = time.perf_counter()
    kept, unseen = (np.random.default_rng((training.seed, part)) for part in (0, 1))
    draws = torch.Generator().manual_seed(training.seed)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(training.seed)
        network = OrderNetwork(training.width)
    optimizer = torch.optim.Adam(network.parameters(), lr=training.learning_rate)
    measured = [draw_instance(training.sort, unseen) for _ in range(MEASURED)]
    greedy = float(np.mean([schedule_by("greedy", one, 0.0, 0).makespan for one in measured]))
    for update in range(training.updates):
        left = 1 - update / training.updates
        optimizer.param_groups[0]["lr"] = training.learning_rate * (0.01 + 0.99 * left)
        instances = [draw_instance(training.sort, kept) for _ in range(training.instances)]
        orders, relations, is_open = begun(instances, training.samples)
        drawn = draw_orders(network, orders, relations, is_open, draws)
        reinforce(network, optimizer, drawn, relations, training.samples)
        if told is not None and (update + 1) % training.log_every == 0:
            found = draw_orders(network, *begun(measured, 1), draws=None).makespans.mean()
            told(Measured(update + 1, float(found), greedy, time.perf_counter() - began))
    write_weights(training.out, network.state_dict(), FORMAT)
    return network


def begun(instances: Sequence[Instance], samples: int) -> tuple[_core.Orders, Tensor, Tensor]:
    """Orders without any task yet, ``samples`` of each instance side by side.

    Returns:
        The orders, their relations (B, T, T, 2), and which tasks there are (B, T).
    """
    most = max(len(one.tasks) for one in instances)
    relations = torch.zeros(len(instances), most, most, RELATIONS)
    is_open = torch.zeros(len(instances), most, dtype=torch.bool)
    for row, one in enumerate(instances):
        count = len(one.tasks)
        relations[row, :count, :count] = torch.from_numpy(relations_of(one))
        is_open[row, :count] = True
    compiled = [one for one in map(Instance.compiled, instances) for _ in range(samples)]
    relations, is_open = (table.repeat_interleave(samples, 0) for table in (relations, is_open))
    return _core.Orders(compiled), relations, is_open


def main() -> int:
    """Train as the command line says, and tell how far it is."""
    try:
        training = tyro.cli(
            OrderTraining, prog="python -m innerattn.train.orders", description=__doc__
        )
        train_orders(training, _tell)
    except (InnerattnError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"wrote {training.out}")
    return 0


def _tell(found: Measured) -> None:
    ratio = found.makespan / found.greedy
    print(
        f"{found.updates:,} updates, {found.seconds:.0f} s: mean makespan {found.makespan:.2f}, "
        f"{ratio:.3f} of greedy",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(main())
