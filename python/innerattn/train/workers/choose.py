"""How many workers a training has: as many as its configuration says, or as many as pay."""

from __future__ import annotations

import sys

from innerattn.config import RunConfig
from innerattn.config.registry import methods
from innerattn.cores import usable_cores
from innerattn.train.workers.torchrun import started_by_torchrun

_WORTH_ROWS = 1_000_000
"""Rows of training from which another worker pays: it takes some seconds to start."""
_LEAST_ROWS = 128
"""Rows of an update for each worker, below which most of its time does not depend on them."""


def with_number_of_workers(config: RunConfig) -> RunConfig:
    """The configuration with a number for `train.workers`, so that it says what was run.

    It is that of torchrun's processes where it has started this one.
    """
    if config.train.workers != "auto":
        return config
    started = started_by_torchrun()
    if started is not None:
        return config.replace(train=config.train.replace(workers=started))
    return config.replace(train=config.train.replace(workers=workers_that_pay(config)))


def workers_that_pay(config: RunConfig) -> int:
    """The largest number of workers that have a core each, equal shares and enough to do.

    There is one where the run is short, on a GPU, on Windows, of an algorithm that cannot be
    trained by several, or where `train.threads` says how many threads there are.
    """
    train, algorithm = config.train, config.algorithm
    if (
        sys.platform == "win32"
        or train.threads is not None
        or train.device != "cpu"
        or not methods()[train.method].algorithm.averages_over_workers
        or algorithm.rows_of_training(train.env_steps) < _WORTH_ROWS
    ):
        return 1
    # For any team, each control step of all worlds is an update.
    rows = train.num_envs if algorithm.for_any_team else algorithm.rows_per_update
    most = min(usable_cores(), rows // _LEAST_ROWS)
    wholes = config.shared_by_workers().values()
    fitting = (count for count in range(most, 1, -1) if not any(whole % count for whole in wholes))
    return next(fitting, 1)
