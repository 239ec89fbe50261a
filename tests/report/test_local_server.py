"""The server of live pages: who may read them or send messages, and what others get."""

import http.client
import json
import os
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import ThreadingHTTPServer
from typing import Any

import pytest

from innerattn.errors import RunError
from innerattn.report import local_server
from innerattn.report.local_server import HOST, MOST_BODY_BYTES, Answer, LocalServer


def damaged() -> Answer:
    raise RunError("metrics.jsonl: damaged")


PAGES: dict[str, Callable[[], Answer]] = {
    "": lambda: Answer("text/html", "first"),
    "state": lambda: Answer("application/json", "{}"),
    "damaged": damaged,
}


def echo(path: str, body: bytes) -> Answer:
    if path == "damaged":
        damaged()
    return Answer("application/json", json.dumps([path, body.decode()]))


@contextmanager
def served(server: LocalServer) -> Iterator[LocalServer]:
    thread = threading.Thread(target=server.serve)
    thread.start()
    try:
        yield server
    finally:  # a thread that goes on would keep the process from its end
        server.close()
        thread.join()


@pytest.fixture
def server() -> Iterator[LocalServer]:
    with served(LocalServer(PAGES)) as found:
        yield found


@pytest.fixture
def taking() -> Iterator[LocalServer]:
    with served(LocalServer(PAGES, take=echo)) as found:
        yield found


def asked(
    server: LocalServer, path: str, method: str = "GET", body: bytes | None = None, **headers: str
) -> Any:
    """Status, headers and text of an answer."""
    connection = http.client.HTTPConnection(HOST, server.port, timeout=10)
    named = {k.replace("_", "-"): v for k, v in headers.items()}
    connection.request(method, path, body, named)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def test_the_address_gives_the_pages(server: LocalServer) -> None:
    status, headers, text = asked(server, f"/{server.word}/")
    assert (status, text, headers["Content-Type"]) == (200, "first", "text/html; charset=utf-8")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert asked(server, f"/{server.word}/state?after=1")[2] == "{}"
    assert server.address == f"http://127.0.0.1:{server.port}/{server.word}/"
    own = f"http://localhost:{server.port}"
    assert asked(server, f"/{server.word}/state", Origin=own)[0] == 200


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, 403),
        ("/guessed/state", {}, 403),
        ("/{word}x/state", {}, 403),
        ("/{word}/../run.json", {}, 404),
        ("/{word}/%2e%2e/run.json", {}, 404),
        ("/{word}/nothing", {}, 404),
        ("/{word}/state", {"Host": "evil.example"}, 403),
        ("/{word}/state", {"Host": "127.0.0.1:1"}, 403),
        ("/{word}/state", {"Origin": "http://evil.example"}, 403),
        ("/{word}/state", {"Origin": "null"}, 403),
        ("/{word}/state", {"Sec_Fetch_Site": "cross-site"}, 403),
    ],
)
def test_others_get_nothing(
    server: LocalServer, path: str, headers: dict[str, str], status: int
) -> None:
    found, _, text = asked(server, path.format(word=server.word), **headers)
    assert found == status
    assert text in ("not from this page", "not the address of this page", "no such page")


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_nothing_can_be_sent(server: LocalServer, method: str) -> None:
    assert asked(server, f"/{server.word}/state", method)[0] == 501


def test_an_error_is_one_line(server: LocalServer) -> None:
    status, _, text = asked(server, f"/{server.word}/damaged")
    assert (status, text) == (404, "metrics.jsonl: damaged")


def test_a_taken_port_and_two_words(server: LocalServer) -> None:
    with pytest.raises(RunError, match=f"--port {server.port}: is taken"):
        LocalServer(PAGES, server.port)
    other = LocalServer(PAGES)
    assert other.word != server.word
    assert len(server.word) >= 20
    other._server.server_close()


JSON = {"Content_Type": "application/json"}


@pytest.mark.usefixtures("interruptible")
def test_an_interruption_inside_a_request_ends_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    def handled(self: ThreadingHTTPServer, *request: Any) -> None:
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:  # as the start of a thread does with it
            raise RuntimeError("release unlocked lock") from None
        process(self, *request)

    process = ThreadingHTTPServer.process_request
    monkeypatch.setattr(ThreadingHTTPServer, "process_request", handled)
    server, answers = LocalServer(PAGES), []

    def ask() -> None:
        with suppress(TimeoutError):
            answers.append(asked(server, f"/{server.word}/")[2])
        server.close()  # in case nothing has ended it

    asking = threading.Thread(target=ask)
    asking.start()
    with pytest.raises(KeyboardInterrupt):
        server.serve()
    asking.join()
    assert answers == ["first"]
    with socket.socket() as free:  # closed connections may still be known to the system
        free.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        free.bind((HOST, server.port))


def test_messages_are_taken(taking: LocalServer) -> None:
    path = f"/{taking.word}/sessions/x?y"
    status, headers, text = asked(taking, path, "POST", b"{}", **JSON)
    assert (status, json.loads(text)) == (200, ["sessions/x", "{}"])
    assert headers["Content-Type"] == "application/json; charset=utf-8"
    largest = b"x" * MOST_BODY_BYTES
    assert asked(taking, path, "POST", largest, **JSON)[0] == 200
    assert asked(taking, f"/{taking.word}/")[2] == "first"


@pytest.mark.parametrize(
    ("path", "body", "headers", "status"),
    [
        ("/guessed/sessions", b"{}", JSON, 403),
        ("/{word}/sessions", b"{}", JSON | {"Host": "evil.example"}, 403),
        ("/{word}/sessions", b"{}", JSON | {"Origin": "http://evil.example"}, 403),
        ("/{word}/sessions", b"{}", JSON | {"Origin": "null"}, 403),
        ("/{word}/sessions", b"{}", JSON | {"Sec_Fetch_Site": "same-site"}, 403),
        ("/{word}/sessions", b"{}", {}, 415),
        ("/{word}/sessions", b"{}", {"Content_Type": "text/plain"}, 415),
        ("/{word}/sessions", b"x" * (MOST_BODY_BYTES + 1), JSON, 413),
        ("/{word}/sessions", b"", JSON | {"Content_Length": "9" * 400}, 413),
        ("/{word}/sessions", b"", JSON | {"Content_Length": "-1"}, 411),
        ("/{word}/sessions", b"", JSON | {"Content_Length": "\u00b2"}, 411),
        ("/{word}/sessions", b"{}", JSON | {"Transfer_Encoding": "chunked"}, 411),
        ("/{word}/damaged", b"{}", JSON, 400),
    ],
)
def test_messages_of_others_are_refused(
    taking: LocalServer, path: str, body: bytes, headers: dict[str, str], status: int
) -> None:
    found, answered, text = asked(taking, path.format(word=taking.word), "POST", body, **headers)
    assert found == status
    assert answered["Content-Type"] == "application/json; charset=utf-8"
    assert list(json.loads(text)) == ["error"]


def test_a_message_without_a_length_is_not_waited_for(taking: LocalServer) -> None:
    with socket.create_connection((HOST, taking.port), timeout=10) as connection:
        head = f"POST /{taking.word}/sessions HTTP/1.1\r\nHost: {HOST}:{taking.port}\r\n"
        connection.sendall(f"{head}Content-Type: application/json\r\n\r\n".encode())
        assert b" 411 " in connection.recv(4096).split(b"\r\n")[0]


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS"])
def test_nothing_else_can_be_asked_for(taking: LocalServer, method: str) -> None:
    assert asked(taking, f"/{taking.word}/sessions", method, **JSON)[0] == 501


def raw(server: LocalServer, request: bytes) -> bytes:
    """The first answer to some bytes; empty where the connection just ends."""
    with socket.create_connection((HOST, server.port), timeout=10) as connection:
        connection.sendall(request)
        with suppress(ConnectionError):
            return connection.recv(65_536)
        return b""


def get(server: LocalServer, path: str, *more: str) -> bytes:
    lines = (f"GET {path} HTTP/1.1", f"Host: {HOST}:{server.port}", *more, "", "")
    return "\r\n".join(lines).encode()


@pytest.mark.parametrize(
    ("request_of", "status"),
    [
        (lambda s: get(s, "http://["), 403),
        (lambda s: get(s, f"http://evil.example/{s.word}/"), 403),
        (lambda s: get(s, f"//evil.example/{s.word}/"), 403),
        (lambda s: get(s, f"/{s.word}/", "Host: evil.example"), 403),
        (lambda s: get(s, f"/{s.word}/", f"Host: {HOST}:{s.port}"), 403),
        (lambda s: get(s, f"/{s.word}/", *2 * [f"Origin: http://{HOST}:{s.port}"]), 403),
        (lambda s: get(s, f"/{s.word}/", *2 * ["Sec-Fetch-Site: none"]), 403),
        (lambda s: get(s, f"/{s.word}/", *2 * ["Content-Type: application/json"]), 403),
        (lambda s: get(s, f"/{s.word}/", *2 * ["Content-Length: 0"]), 403),
        (lambda _: b"GET /\r\n\r\n", 403),  # HTTP/0.9 knows no headers
        (lambda s: get(s, "x" * 70_000), 414),
        (lambda s: get(s, f"/{s.word}/", "a: " + "x" * 70_000), 431),
        (lambda s: get(s, f"/{s.word}/", *[f"a{n}: 1" for n in range(200)]), 431),
        (lambda s: get(s, f"/{s.word}/").replace(b"HTTP/1.1", b"HTTP/9.9"), 505),
        (lambda s: get(s, f"/{s.word}/").replace(b"GET", b"\x00\xff"), 501),
        (lambda s: get(s, f"/{s.word}/").replace(b"GET", b"BREW"), 501),
        (lambda s: get(s, "/a b c d"), 400),
        (lambda s: get(s, "/\ud800".encode("utf-8", "surrogatepass").decode("latin-1")), 400),
    ],
)
def test_odd_requests_are_refused_with_the_headers_of_every_page(
    taking: LocalServer,
    request_of: Callable[[LocalServer], bytes],
    status: int,
    capfd: pytest.CaptureFixture[str],
) -> None:
    head, _, text = raw(taking, request_of(taking)).partition(b"\r\n\r\n")
    assert head.split()[1] == str(status).encode()
    assert b"Content-Security-Policy: default-src 'none'" in head
    assert b"first" not in text
    assert asked(taking, f"/{taking.word}/")[2] == "first"
    assert capfd.readouterr() == ("", "")


def test_nothing_is_printed_of_a_connection_that_breaks(
    capfd: pytest.CaptureFixture[str],
) -> None:
    reset = struct.pack("ii", 1, 0)
    began, go_on = threading.Event(), threading.Event()

    def slow() -> Answer:
        began.set()
        go_on.wait(10)
        return Answer("text/plain", "x" * 10_000_000)

    with served(LocalServer({"": slow})) as server:
        connection = socket.create_connection((HOST, server.port), timeout=10)
        connection.sendall(get(server, f"/{server.word}/"))
        assert began.wait(10)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
        connection.close()
        go_on.set()
        assert asked(server, f"/{server.word}/")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_a_fault_of_a_page_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    def faulty(*_: object) -> Answer:
        raise ZeroDivisionError("a secret")

    with served(LocalServer({"": faulty}, take=faulty)) as server:
        for method in ("GET", "POST"):
            status, headers, text = asked(server, f"/{server.word}/", method, b"{}", **JSON)
            assert status == 500
            assert "secret" not in text
            assert "Content-Security-Policy" in headers
    assert capfd.readouterr().err.splitlines() == 2 * [
        "innerattn: error: ZeroDivisionError: a secret"
    ]


def test_clients_that_trickle_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, "REQUEST_WITHIN_S", 0.3)
    with served(LocalServer(PAGES, take=echo)) as server:
        head = get(server, f"/{server.word}/")[:-2] + b"a: "
        with socket.create_connection((HOST, server.port), timeout=0.05) as connection:
            ended = False
            for byte in head + b"x" * 200:  # 10 s, were it let
                try:
                    connection.sendall(bytes([byte]))
                    ended = connection.recv(1) == b""
                except TimeoutError:
                    continue
                except ConnectionError:
                    ended = True
                if ended:
                    break
            assert ended
        assert asked(server, f"/{server.word}/")[2] == "first"


def test_connections_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, "MOST_CONNECTIONS", 3)
    with served(LocalServer(PAGES)) as server:
        held = [socket.create_connection((HOST, server.port), timeout=10) for _ in range(3)]
        for connection in held:  # each is served once it is answered
            connection.sendall(get(server, f"/{server.word}/"))
            assert b" 200 " in connection.recv(4096)
        assert raw(server, get(server, f"/{server.word}/")) == b""
        for connection in held:
            connection.close()
        for _ in range(100):
            with suppress(OSError, http.client.HTTPException):
                if asked(server, f"/{server.word}/")[2] == "first":
                    break
        else:
            raise AssertionError("places are not given back")


def test_threads_that_cannot_start_keep_no_place(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(local_server, "MOST_CONNECTIONS", 3)
    with served(LocalServer(PAGES)) as server:
        with monkeypatch.context() as without:
            without.setattr(threading.Thread, "start", no_thread)
            for _ in range(4):
                assert raw(server, get(server, f"/{server.word}/")) == b""
        assert asked(server, f"/{server.word}/")[2] == "first"
    assert capfd.readouterr() == ("", "")


def no_thread(_: threading.Thread) -> None:
    raise RuntimeError("can't start new thread")


def test_clients_that_do_not_take_their_answer_are_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(local_server, "TAKEN_WITHIN_S", 0.3)
    size = 50_000_000
    pages = {"": lambda: Answer("text/plain", "x" * size), "small": PAGES[""]}
    with served(LocalServer(pages)) as server:
        with socket.create_connection((HOST, server.port), timeout=10) as connection:
            connection.sendall(get(server, f"/{server.word}/"))
            read = 0
            for _ in range(20):  # slowly, at first
                read += len(connection.recv(1000))
                time.sleep(0.05)
            with suppress(ConnectionError):
                while got := connection.recv(1_000_000):
                    read += len(got)
            assert read < size
        assert asked(server, f"/{server.word}/small")[2] == "first"
