"""Workers that torchrun has started, on one machine or several; they exchange tensors by gloo."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor

from innerattn.errors import ConfigError
from innerattn.learn import workers
from innerattn.train.workers.exchange import WorkerEndedError
from innerattn.train.workers.states import bytes_of_all


def started_by_torchrun() -> int | None:
    """How many processes torchrun has started; None where it has not started this one."""
    if "TORCHELASTIC_RUN_ID" not in os.environ:
        return None
    return int(os.environ["WORLD_SIZE"])


def is_other_worker() -> bool:
    """Whether this process is one of torchrun's workers that records and prints nothing."""
    return started_by_torchrun() is not None and os.environ["RANK"] != "0"


class OfTorchrun:
    """What one worker knows of the others; its contract is `innerattn.learn.workers.Workers`."""

    def __init__(self) -> None:
        """Join the others; they all do."""
        import torch.distributed as dist

        dist.init_process_group("gloo")
        self.rank, self.count = dist.get_rank(), dist.get_world_size()

    def gather(self, values: Tensor) -> Tensor:
        """The values (n,) of all workers, (W, n).

        Raises:
            WorkerEndedError: another worker ended.
        """
        import torch.distributed as dist

        own = values.contiguous().view(torch.uint8)
        found = torch.empty(self.count * len(own), dtype=torch.uint8)
        try:
            dist.all_gather_into_tensor(found, own)
        except RuntimeError as error:  # gloo has no kind of its own for a lost connection
            raise WorkerEndedError(None, str(error).splitlines()[0]) from error
        return found.view(self.count, len(own)).view(values.dtype)


@contextmanager
def joined_of_torchrun(count: int | Literal["auto"], run: Path) -> Iterator[Path]:
    """Let this process be one of torchrun's workers inside the block.

    Args:
        count: how many the configuration wants.
        run: the folder of the run, as this worker would call it.

    Yields:
        The folder, as worker 0 calls it.

    Raises:
        ConfigError: there are others than ``count``.
    """
    import torch.distributed as dist

    found = started_by_torchrun()
    if found != count:
        raise ConfigError(f"train.workers = {count}: must be {found}, as many as torchrun started")
    others = OfTorchrun()
    try:
        with workers.joined(others):
            yield Path(os.fsdecode(bytes_of_all(os.fsencode(run.absolute()))[0]))
    finally:
        dist.destroy_process_group()
