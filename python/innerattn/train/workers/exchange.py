"""Exchanges tensors between the workers of one machine, through memory that all of them map.

Every worker writes its values into a slot of its own, waits until all have written, and reads all
slots in the order of ranks: so all get the same bits, whatever the timing. There are two sets of
slots, used in turn. A worker writes into a set again only after all have written into the other
one, so after all have read it.

To wait is to read a byte from a socket: it sleeps, and it ends when the other process ends.
"""

from __future__ import annotations

import mmap
import socket
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from innerattn.errors import RunError

SLOT_BYTES = 4 << 20
"""Bytes of values that are exchanged at a time; the system gives memory only to what is used."""
_HEAD_BYTES = 64
_HERE, _FAILED = b".", b"!"


class WorkerEndedError(RunError):
    """Another worker failed, or its process is gone.

    Attributes:
        rank: Its number; None where that is not known.
        text: What it told of itself; empty if it told nothing.
    """

    def __init__(self, rank: int | None, text: str = "") -> None:
        """Say which one, and why."""
        name = "another worker" if rank is None else f"worker {rank}"
        super().__init__(f"{name}: {text}" if text else f"{name} is gone")
        self.rank, self.text = rank, text


class Exchange:
    """What one worker knows of the others; its contract is `innerattn.learn.workers.Workers`.

    Attributes:
        rank: Number of this worker, from 0.
        count: How many there are.
    """

    def __init__(
        self, rank: int, count: int, memory: mmap.mmap, sockets: Sequence[socket.socket]
    ) -> None:
        """Join.

        Args:
            rank: of this worker.
            count: of all.
            memory: the same `memory_bytes` for all.
            sockets: to worker 0; of worker 0, to each other one in the order of ranks.
        """
        self.rank, self.count = rank, count
        self._sockets = sockets
        slots = np.frombuffer(memory, np.uint8).reshape(2, count, _HEAD_BYTES + SLOT_BYTES)
        self._slots = torch.from_numpy(slots)
        self._calls = 0

    def gather(self, values: Tensor) -> Tensor:
        """The values (n,) of all workers, (W, n).

        They stay as they are until the exchange after the next one.

        Raises:
            WorkerEndedError: another worker ended.
            RuntimeError: the workers are out of step, which is an error in this package.
        """
        own = values.contiguous().view(torch.uint8)
        size = len(own)
        if size <= SLOT_BYTES:
            return self._exchanged(own, size).view(values.dtype)
        found = torch.empty(self.count, size, dtype=torch.uint8)
        for first in range(0, size, SLOT_BYTES):
            part = own[first : first + SLOT_BYTES]
            found[:, first : first + len(part)] = self._exchanged(part, size)
        return found.view(values.dtype)

    def fail(self, text: str) -> None:
        """Tell worker 0 why this one ends; nobody may listen any more."""
        for one in self._sockets:
            try:
                one.sendall(_FAILED + text.encode())
            except OSError:
                continue

    def close(self) -> None:
        """Let the others learn of the end."""
        for one in self._sockets:
            one.close()

    def _exchanged(self, own: Tensor, size: int) -> Tensor:
        """Bytes of all workers (W, n), part of ``size`` bytes."""
        slots = self._slots[self._calls % 2]
        self._calls += 1
        head = slots[:, :16].view(torch.int64)
        head[self.rank, 0], head[self.rank, 1] = self._calls, size
        slots[self.rank, _HEAD_BYTES : _HEAD_BYTES + len(own)] = own
        self._meet()
        if not bool((head == head[0]).all()):
            raise RuntimeError(f"workers are out of step: {head.tolist()}")
        return slots[:, _HEAD_BYTES : _HEAD_BYTES + len(own)]

    def _meet(self) -> None:
        """Wait until every worker is here."""
        if self.rank:
            self._tell(0)
            self._hear(0)
            return
        for rank in range(1, self.count):
            self._hear(rank)
        for rank in range(1, self.count):
            self._tell(rank)

    def _tell(self, rank: int) -> None:
        try:
            self._socket(rank).send(_HERE)
        except OSError as error:
            raise WorkerEndedError(rank) from error

    def _hear(self, rank: int) -> None:
        try:
            word = self._socket(rank).recv(1)
        except OSError as error:
            raise WorkerEndedError(rank) from error
        if word == _FAILED:
            text = b"".join(iter(lambda: self._socket(rank).recv(4096), b""))
            raise WorkerEndedError(rank, text.decode(errors="replace"))
        if word != _HERE:
            raise WorkerEndedError(rank)

    def _socket(self, rank: int) -> socket.socket:
        return self._sockets[0] if self.rank else self._sockets[rank - 1]


def memory_bytes(count: int) -> int:
    """Size of the memory that ``count`` workers share."""
    return 2 * count * (_HEAD_BYTES + SLOT_BYTES)
