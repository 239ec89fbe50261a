"""A small server of a live page: on this machine alone, for whoever has its address.

The address holds a random word. Requests with another word, host or origin are refused, so that
neither another user of the network nor a foreign page in the same browser can read anything.
"""

from __future__ import annotations

import errno
import secrets
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import NamedTuple
from urllib.parse import urlsplit

from innerattn.errors import InnerattnError, RunError, one_line

HOST = "127.0.0.1"

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


class Answer(NamedTuple):
    """What a page is: its type, such as "text/html", and its text."""

    kind: str
    text: str


class LocalServer:
    """Serves pages by name under a random word; a page is made anew for each request.

    Args:
        pages: what gives each page, by its path without a slash in front ("" is the first one); an
            `InnerattnError` becomes a page of status 404 with its one line.
        port: of 127.0.0.1; 0: any that is free.

    Raises:
        RunError: the port is taken or may not be used.
    """

    def __init__(self, pages: Mapping[str, Callable[[], Answer]], port: int = 0) -> None:
        self.word = secrets.token_urlsafe(16)
        handler = type("Handler", (_Handler,), {"pages": pages, "word": self.word})
        try:
            self._server = ThreadingHTTPServer((HOST, port), handler)
        except OSError as error:
            why = "is taken" if error.errno == errno.EADDRINUSE else str(error.strerror)
            raise RunError(f"--port {port}: {why}") from error
        self._server.daemon_threads = True

    @property
    def port(self) -> int:
        """The port that is served."""
        return int(self._server.server_address[1])

    @property
    def address(self) -> str:
        """The address of the first page."""
        return f"http://{HOST}:{self.port}/{self.word}/"

    def serve(self) -> None:
        """Serve until `close` is called from another thread, or until Ctrl-C."""
        try:
            self._server.serve_forever(poll_interval=0.1)
        finally:
            self._server.server_close()

    def close(self) -> None:
        """End `serve`."""
        self._server.shutdown()


class _Handler(BaseHTTPRequestHandler):
    pages: Mapping[str, Callable[[], Answer]]
    word: str
    timeout = 30.0
    server_version = "innerattn"
    sys_version = ""

    def do_GET(self) -> None:
        """Answer a request, or refuse it."""
        path = urlsplit(self.path).path
        _, word, name = [*path.split("/", 2), "", ""][:3]
        if not self._is_local():
            self._send(HTTPStatus.FORBIDDEN, Answer("text/plain", "not from this page"))
        elif not secrets.compare_digest(word.encode(), self.word.encode()):
            self._send(HTTPStatus.FORBIDDEN, Answer("text/plain", "not the address of this page"))
        elif name not in self.pages:
            self._send(HTTPStatus.NOT_FOUND, Answer("text/plain", "no such page"))
        else:
            try:
                status, answer = HTTPStatus.OK, self.pages[name]()
            except (InnerattnError, OSError) as error:
                status, answer = HTTPStatus.NOT_FOUND, Answer("text/plain", one_line(error))
            self._send(status, answer)

    def _is_local(self) -> bool:
        """Whether host and origin are this server's own."""
        port = self.server.server_address[1]  # type: ignore[index]
        own = [f"{host}:{port}" for host in (HOST, "localhost")]
        origin = self.headers.get("Origin")
        site = self.headers.get("Sec-Fetch-Site", "same-origin")
        return (
            self.headers.get("Host") in own
            and (origin is None or origin in [f"http://{host}" for host in own])
            and site in ("same-origin", "none")
        )

    def _send(self, status: HTTPStatus, answer: Answer) -> None:
        data = answer.text.encode()
        self.send_response(status)
        self.send_header("Content-Type", f"{answer.kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(data)))
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing: the word in the address is a secret."""
