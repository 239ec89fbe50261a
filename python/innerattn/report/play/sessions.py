"""Pages that play, each with a world of its own; a world without its page is freed."""

from __future__ import annotations

import json
import secrets
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from typing import Any

import numpy as np

from innerattn.errors import InnerattnError, WorldError, one_line
from innerattn.evaluate.interactive import InteractiveWorld
from innerattn.report.local_server import Answer
from innerattn.report.play.messages import End, read_message
from innerattn.report.play.state import SCHEMA_VERSION, opening_document, state_document

MOST_SESSIONS = 8
IDLE_S = 150.0
"""A page that is open sends a message every 20 s, or every minute where its tab is hidden."""


class _Session:
    def __init__(self, world: InteractiveWorld, now: float) -> None:
        self.world, self.heard = world, now
        self.lock = threading.Lock()


class Sessions:
    """Takes the messages of all pages. A world moves only when its own page asks for it."""

    def __init__(
        self,
        make: Callable[[], InteractiveWorld],
        *,
        most: int = MOST_SESSIONS,
        idle_s: float = IDLE_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin without a page.

        Args:
            make: makes the world of a page.
            most: pages at a time.
            idle_s: after so long without a message a page counts as closed [s].
            clock: gives the time [s].
        """
        self._make, self._most, self._idle_s, self._clock = make, most, idle_s, clock
        self._open: dict[str, _Session] = {}
        self._opening = 0
        self._lock = threading.Lock()

    def __len__(self) -> int:
        """Pages that are open."""
        with self._lock:
            self._forget_idle()
            return len(self._open)

    def take(self, path: str, body: bytes) -> Answer:
        """Answer a message: to ``sessions`` it opens a page, to ``sessions/ID`` it is its own."""
        name, _, session = path.partition("/")
        if name != "sessions":
            return _problem(HTTPStatus.NOT_FOUND, "no such page")
        try:
            return self._take(session, body) if session else self._opened()
        except WorldError as error:
            return _problem(HTTPStatus.INTERNAL_SERVER_ERROR, one_line(error))
        except (InnerattnError, ValueError) as error:
            return _problem(HTTPStatus.BAD_REQUEST, one_line(error))

    def _opened(self) -> Answer:
        key = secrets.token_urlsafe(12)
        with self._lock:
            self._forget_idle()
            if len(self._open) + self._opening >= self._most:
                text = f"{self._most} pages are open, the most at a time: close one, then reload"
                return _problem(HTTPStatus.SERVICE_UNAVAILABLE, text)
            self._opening += 1
        try:
            session = _Session(self._make(), self._clock())  # other pages go on in the meantime
            document = opening_document(key, session.world)
        finally:
            with self._lock:
                self._opening -= 1
        with self._lock:
            self._open[key] = session
        return _json(document)

    def _take(self, key: str, body: bytes) -> Answer:
        message = read_message(body)
        with self._lock:
            self._forget_idle()
            session = self._open.get(key)
            if session is None:
                text = "this session has ended: reload the page to begin another one"
                return _problem(HTTPStatus.GONE, text)
            session.heard = self._clock()
            if isinstance(message, End):
                del self._open[key]
        with session.lock:
            try:
                with np.errstate(over="ignore"):  # the world refuses what float32 cannot hold
                    message.apply(session.world)
            except WorldError:
                session.world.restart()
                raise
            return _json(state_document(session.world.moment()))

    def _forget_idle(self) -> None:
        """Drop what no page has asked for; the world is freed with the session."""
        latest = self._clock() - self._idle_s
        self._open = {key: one for key, one in self._open.items() if one.heard >= latest}


def _json(document: dict[str, Any], status: HTTPStatus = HTTPStatus.OK) -> Answer:
    text = json.dumps(document, allow_nan=False, separators=(",", ":"))
    return Answer("application/json", text, status)


def _problem(status: HTTPStatus, text: str) -> Answer:
    return _json({"schema_version": SCHEMA_VERSION, "error": text}, status)
