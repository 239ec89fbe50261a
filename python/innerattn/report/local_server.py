"""A small server of a live page: on this machine alone, for whoever has its address.

The address holds a random word. Requests with another word, host or origin are refused, so that
neither another user of the network nor a foreign page in the same browser can read anything.
"""

from __future__ import annotations

import errno
import json
import secrets
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import FrameType
from typing import Any, NamedTuple

from innerattn.errors import InnerattnError, RunError, one_line
from innerattn.signals import Interrupted, requests_handled_by

HOST = "127.0.0.1"
MOST_BODY_BYTES = 4096
"""Longest message that a page may send."""
REQUEST_WITHIN_S = 30.0
"""How long a client may take to send a request, from its connection or its last answer on."""
TAKEN_WITHIN_S = 300.0
"""How long a client may take to read an answer."""
MOST_CONNECTIONS = 64
"""As many connections are served at a time; others are closed at once."""

_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'self' 'unsafe-inline'; "
    "img-src data:; connect-src 'self'; frame-src 'self'; frame-ancestors 'self'; "
    "base-uri 'none'; form-action 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_ONCE = ("Host", "Origin", "Sec-Fetch-Site", "Content-Type", "Content-Length")
"""Headers that a request may have once: of two, one would be checked and the other one obeyed."""


class Answer(NamedTuple):
    """What a page is: its type, such as "text/html", its text, and a status."""

    kind: str
    text: str
    status: HTTPStatus = HTTPStatus.OK


Take = Callable[[str, bytes], Answer]
"""Takes a message: the path that it was sent to, and its body."""


def problem(status: HTTPStatus, text: str) -> Answer:
    """The answer to a message that is refused: JSON with one line, ``error``."""
    return Answer("application/json", json.dumps({"error": text}), status)


class LocalServer:
    """Serves pages by name under a random word; a page is made anew for each request.

    Args:
        pages: what gives each page, by its path without a slash in front ("" is the first one); an
            `InnerattnError` becomes a page of status 404 with its one line.
        port: of 127.0.0.1; 0: any that is free.
        take: takes JSON messages (POST) of at most `MOST_BODY_BYTES`; none: nothing can be sent.

    Raises:
        RunError: the port is taken or may not be used.
    """

    def __init__(
        self, pages: Mapping[str, Callable[[], Answer]], port: int = 0, take: Take | None = None
    ) -> None:
        self.word = secrets.token_urlsafe(16)
        kind: type[_Handler] = _Handler if take is None else _TakingHandler
        members = {"pages": pages, "word": self.word, "take": staticmethod(take or _nothing)}
        try:
            self._server = _Server((HOST, port), type("Handler", (kind,), members))
        except OSError as error:
            why = "is taken" if error.errno == errno.EADDRINUSE else str(error.strerror)
            raise RunError(f"--port {port}: {why}") from error

    @property
    def port(self) -> int:
        """The port that is served."""
        return int(self._server.server_address[1])

    @property
    def address(self) -> str:
        """The address of the first page."""
        return f"http://{HOST}:{self.port}/{self.word}/"

    def serve(self, begun: Callable[[], object] = lambda: None) -> None:
        """Serve until `close` is called from another thread.

        Args:
            begun: called first; who connects from then on is answered.

        Raises:
            Interrupted: a signal asked for the end, such as Ctrl-C; no request is cut short.
        """
        try:
            begun()
            with requests_handled_by(self._server.note):
                self._server.serve_forever(poll_interval=0.1)
        finally:
            self._server.server_close()

    def close(self) -> None:
        """End `serve`."""
        self._server.shutdown()


class _Server(ThreadingHTTPServer):
    """Ends between two requests: inside one, an exception of a signal would be lost as its own."""

    daemon_threads = True
    noted: int | None = None

    def __init__(self, address: tuple[str, int], handler: type[_Handler]) -> None:
        super().__init__(address, handler)
        self.until: dict[socket.socket, float] = {}
        """When connections that send a request or read an answer are ended; `time.monotonic`."""
        self._open = 0
        self._count = threading.Lock()

    def note(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        del frame
        self.noted = number

    def service_actions(self) -> None:
        """Raise what was noted, and end what takes too long; called ten times a second."""
        if self.noted is not None:
            raise Interrupted(self.noted)
        now = time.monotonic()
        for connection in [one for one, until in self.until.copy().items() if until < now]:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Let a thread serve a connection, unless there are too many."""
        with self._count:
            full = self._open >= MOST_CONNECTIONS
            self._open += not full
        if full:
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except RuntimeError:  # no thread could be started
            self._let_go()
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection to its end."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._let_go()

    def _let_go(self) -> None:
        with self._count:
            self._open -= 1

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing of a connection that breaks, and one line of a fault of ours."""
        del request, client_address
        error = sys.exc_info()[1]
        if isinstance(error, Exception) and not isinstance(error, OSError):
            _fault(error)


def _fault(error: Exception) -> str:
    """Print what failed in one line; what a stranger may know of it."""
    print(f"innerattn: error: {type(error).__name__}: {one_line(error)}", file=sys.stderr)
    return "this page has a fault"


def _nothing(path: str, body: bytes) -> Answer:
    del path, body
    return problem(HTTPStatus.NOT_FOUND, "no such page")


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    pages: Mapping[str, Callable[[], Answer]]
    word: str
    take: Take
    timeout = 30.0
    protocol_version = "HTTP/1.1"
    server_version = "innerattn"
    sys_version = ""
    wbufsize = -1  # an answer is one write, which nothing delays
    disable_nagle_algorithm = True

    def do_GET(self) -> None:
        """Answer a request, or refuse it."""
        self._is_whole()
        name, refusal = self._asked()
        if refusal is not None:
            self._send(Answer("text/plain", refusal, HTTPStatus.FORBIDDEN))
        elif name not in self.pages:
            self._send(Answer("text/plain", "no such page", HTTPStatus.NOT_FOUND))
        else:
            try:
                answer = self.pages[name]()
            except (InnerattnError, OSError) as error:
                answer = Answer("text/plain", one_line(error), HTTPStatus.NOT_FOUND)
            except Exception as error:
                answer = Answer("text/plain", _fault(error), HTTPStatus.INTERNAL_SERVER_ERROR)
            self._send(answer)

    def _asked(self) -> tuple[str, str | None]:
        """The name that is asked for, and why nothing is given; none: it may be given."""
        path = self.path.partition("?")[0].partition("#")[0]
        first, word, name = [*path.split("/", 2), "", ""][:3]
        if first or not self._is_local():  # an address with a host is of another server
            return name, "not from this page"
        if not secrets.compare_digest(word.encode(), self.word.encode()):
            return name, "not the address of this page"
        return name, None

    def _is_local(self) -> bool:
        """Whether host and origin are this server's own."""
        port = self.server.server_address[1]
        own = [f"{host}:{port}" for host in (HOST, "localhost")]
        origin = self.headers.get("Origin")
        site = self.headers.get("Sec-Fetch-Site", "same-origin")
        return (
            all(len(self.headers.get_all(name, [])) <= 1 for name in _ONCE)
            and self.headers.get("Host") in own
            and (origin is None or origin in [f"http://{host}" for host in own])
            and site in ("same-origin", "none")
        )

    def _send(self, answer: Answer) -> None:
        data = answer.text.encode(errors="backslashreplace")
        self.request_version = self.protocol_version  # an older one would be sent no headers
        self._has(TAKEN_WITHIN_S)
        self.send_response(answer.status)
        self.send_header("Content-Type", f"{answer.kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(data)))
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse what is no request that can be answered, with the headers of every page."""
        del explain
        self.close_connection = True
        status = HTTPStatus(code)
        self._send(Answer("text/plain", message or status.phrase, status))

    def handle_one_request(self) -> None:
        """Wait for a request, answer it, and let go of a client that takes too long to ask."""
        self._has(REQUEST_WITHIN_S)
        try:
            super().handle_one_request()
        finally:
            self._is_whole()

    def _has(self, seconds: float) -> None:
        """The client has this long, however it takes or sends bytes."""
        self.server.until[self.connection] = time.monotonic() + seconds

    def _is_whole(self) -> None:
        """The request was read, or its answer was taken."""
        self.server.until.pop(self.connection, None)

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing: the word in the address is a secret."""


class _TakingHandler(_Handler):
    def do_POST(self) -> None:
        """Take a message, or refuse it before it is read."""
        name, refusal = self._asked()
        length = self.headers.get("Content-Length", "")
        if refusal is not None:
            self._refuse(HTTPStatus.FORBIDDEN, refusal)
        elif self.headers.get_content_type() != "application/json":
            self._refuse(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "a message must be application/json")
        elif not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in self.headers:
            self._refuse(HTTPStatus.LENGTH_REQUIRED, "a message must have a Content-Length")
        elif len(length) > 9 or int(length) > MOST_BODY_BYTES:
            text = f"a message must be at most {MOST_BODY_BYTES:,} bytes"
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, text)
        else:
            body = self.rfile.read(int(length))
            if len(body) < int(length):  # the connection ended in the middle
                self.close_connection = True
                return
            self._is_whole()
            try:
                answer = type(self).take(name, body)
            except (InnerattnError, OSError) as error:
                answer = problem(HTTPStatus.BAD_REQUEST, one_line(error))
            except Exception as error:
                answer = problem(HTTPStatus.INTERNAL_SERVER_ERROR, _fault(error))
            self._send(answer)

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        """Refuse a message, whose body is never read: nothing else comes over this connection."""
        self.close_connection = True
        self._send(problem(status, text))
