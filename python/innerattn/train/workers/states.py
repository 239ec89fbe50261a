"""The states of all workers, brought together for a checkpoint; and each one's part of it.

Names of worker 0 are as they are without others. Those of worker 1 begin with "worker1.".
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, TypeVar

import torch
from pydantic import TypeAdapter
from safetensors.torch import load, save
from torch import Tensor

from innerattn.learn import workers
from innerattn.learn.resume import State
from innerattn.train.checkpoint_info import RowsInfo

_ROWS = TypeAdapter(dict[str, RowsInfo])
Value = TypeVar("Value")


def own_name() -> str:
    """What the names of this worker's parts of a checkpoint begin with; empty for worker 0."""
    return _name(workers.rank())


def own_part(named: Mapping[str, Value]) -> dict[str, Value]:
    """What is this worker's of a checkpoint's tensors or rows, by their names in this worker."""
    if workers.rank():
        first = own_name()
        return {k.removeprefix(first): v for k, v in named.items() if k.startswith(first)}
    others = tuple(_name(rank) for rank in range(1, workers.count()))
    return {k: v for k, v in named.items() if not k.startswith(others)}


def state_of_all(state: State) -> dict[str, Tensor]:
    """Every worker's state by name, for worker 0; the others get their own back."""
    found = dict(state)
    sent = b"" if workers.rank() == 0 else save(_plain(state))
    for rank, data in enumerate(bytes_of_all(sent)):
        if rank and workers.rank() == 0:
            found |= {_name(rank) + name: tensor for name, tensor in load(data).items()}
    return found


def rows_of_others(write: Callable[[], Mapping[str, RowsInfo]]) -> dict[str, RowsInfo]:
    """What the others' files of rows hold, for worker 0; each of them writes its own by ``write``.

    Raises:
        OSError: a file of one of them cannot be written.
    """
    told: dict[str, Any] = {"rows": {}}
    if workers.rank():
        try:
            told["rows"] = {name: asdict(one) for name, one in write().items()}
        except OSError as error:
            told = {"errno": error.errno, "why": error.strerror, "file": str(error.filename)}
    found: dict[str, RowsInfo] = {}
    for rank, data in enumerate(bytes_of_all(json.dumps(told).encode())):
        one = json.loads(data)
        if "why" in one:
            raise OSError(one["errno"], one["why"], one["file"])
        rows = _ROWS.validate_json(json.dumps(one["rows"]))
        found |= {_name(rank) + name: info for name, info in rows.items()}
    return found


def _name(rank: int) -> str:
    return f"worker{rank}." if rank else ""


def bytes_of_all(own: bytes) -> list[bytes]:
    """What every worker gives, in the order of ranks."""
    sizes = workers.gathered(torch.tensor([len(own)]))[:, 0].tolist()
    padded = torch.zeros(max(1, *sizes), dtype=torch.uint8)
    if own:
        padded[: len(own)] = torch.frombuffer(bytearray(own), dtype=torch.uint8)
    rows = workers.gathered(padded).numpy()
    return [row[:size].tobytes() for row, size in zip(rows, sizes, strict=True)]


def _plain(state: State) -> dict[str, Tensor]:
    return {name: tensor.detach().cpu().contiguous() for name, tensor in state.items()}
