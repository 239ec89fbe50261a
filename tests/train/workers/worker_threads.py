"""Several workers in threads of this process, for tests of what they exchange."""

import mmap
import socket
import threading
from collections.abc import Callable
from typing import Any

from innerattn.learn import workers
from innerattn.train.workers.exchange import Exchange, memory_bytes

Together = Callable[..., list[Any]]
"""Calls a function with each rank, each in a thread that is that worker; their results."""


class OfThreads:
    """The worker that the present thread is; stands for the one of a process."""

    def __init__(self) -> None:
        self.here = threading.local()

    rank = property(lambda self: self.here.exchange.rank)
    count = property(lambda self: self.here.exchange.count)

    def gather(self, values: object) -> object:
        return self.here.exchange.gather(values)


def exchanges(count: int) -> list[Exchange]:
    """Workers that know each other."""
    memory = mmap.mmap(-1, memory_bytes(count))
    pairs = [socket.socketpair() for _ in range(1, count)]
    first = Exchange(0, count, memory, [one for one, _ in pairs])
    return [first, *(Exchange(k, count, memory, [one]) for k, (_, one) in enumerate(pairs, 1))]


def run_together(count: int, work: Callable[[int], object]) -> list[Any]:
    """See `Together`. An error of a worker is its result."""
    found: list[Any] = [None] * count
    everybody = exchanges(count)
    threads_of_all = OfThreads()

    def one(exchange: Exchange) -> None:
        threads_of_all.here.exchange = exchange
        try:
            found[exchange.rank] = work(exchange.rank)
        except Exception as error:
            found[exchange.rank] = error
        finally:
            exchange.close()

    with workers.joined(threads_of_all):
        threads = [threading.Thread(target=one, args=(each,)) for each in everybody]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(timeout=60)
    return found
