"""Datagrams between robots on this machine, made late and lost on purpose, and robots' clocks."""

from __future__ import annotations

import heapq
import json
import random
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

LOOPBACK = "127.0.0.1"
MOST_BYTES = 65_536


@dataclass(frozen=True)
class LinkSettings:
    """How bad the link between robots is.

    Attributes:
        latency_s: from sending to arriving [s].
        loss: share of messages that are lost, each by itself.
        skew_s: robots' clocks differ from the true time by up to this [s].
    """

    latency_s: float = 0.0
    loss: float = 0.0
    skew_s: float = 0.0


@dataclass(frozen=True)
class Clock:
    """World time of one robot.

    Attributes:
        start: reading of `time.monotonic` at world time 0 [s].
        scale: world seconds in a second of this machine.
        skew_s: how far this clock is ahead [s].
    """

    start: float
    scale: float
    skew_s: float = 0.0

    def now(self) -> float:
        """World time by this clock [s]."""
        return (time.monotonic() - self.start) * self.scale + self.skew_s

    def real(self, world_s: float) -> float:
        """Seconds of this machine in so many world seconds, at least 0."""
        return max(0.0, world_s / self.scale)


def open_socket() -> socket.socket:
    """A datagram socket at a free port of this machine."""
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.bind((LOOPBACK, 0))
    found.setblocking(False)
    return found


def pack(message: Mapping[str, Any]) -> bytes:
    """The bytes of a message."""
    return json.dumps(message, allow_nan=False).encode()


def received(source: socket.socket) -> list[dict[str, Any]]:
    """The messages that wait; whatever is no JSON object is dropped."""
    found = []
    while True:
        try:
            data = source.recv(MOST_BYTES)
        except (BlockingIOError, ConnectionError):  # nobody there any more
            return found
        try:
            message = json.loads(data)
        except ValueError:
            continue
        if isinstance(message, dict):
            found.append(message)


class LossyLink:
    """Sends each message to each peer after a time, or never."""

    def __init__(self, settings: LinkSettings, seed: int) -> None:
        """Draw losses from ``seed``."""
        self.socket = open_socket()
        self._settings = settings
        self._random = random.Random(seed)
        self._waiting: list[tuple[float, int, bytes, int]] = []
        self._count = 0

    @property
    def port(self) -> int:
        """Where this link listens."""
        return int(self.socket.getsockname()[1])

    def send(self, message: Mapping[str, Any], ports: list[int], now: float) -> None:
        """Send to peers, as of world time ``now``."""
        data = pack(message)
        for port in ports:
            if self._random.random() >= self._settings.loss:
                self._count += 1
                due = now + self._settings.latency_s
                heapq.heappush(self._waiting, (due, self._count, data, port))
        self.flush(now)

    def flush(self, now: float) -> None:
        """Send what is due at world time ``now``."""
        while self._waiting and self._waiting[0][0] <= now:
            _, _, data, port = heapq.heappop(self._waiting)
            self.socket.sendto(data, (LOOPBACK, port))

    @property
    def next_due(self) -> float | None:
        """World time at which something is to be sent [s]; None: nothing waits."""
        return self._waiting[0][0] if self._waiting else None
