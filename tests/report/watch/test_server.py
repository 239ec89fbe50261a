"""The server of live pages: who may read them, and what others get."""

import http.client
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from innerattn.errors import RunError
from innerattn.report.watch.server import HOST, Answer, LocalServer


def damaged() -> Answer:
    raise RunError("metrics.jsonl: damaged")


PAGES: dict[str, Callable[[], Answer]] = {
    "": lambda: Answer("text/html", "first"),
    "state": lambda: Answer("application/json", "{}"),
    "damaged": damaged,
}


@pytest.fixture
def server() -> Iterator[LocalServer]:
    found = LocalServer(PAGES)
    thread = threading.Thread(target=found.serve)
    thread.start()
    yield found
    found.close()
    thread.join()


def asked(server: LocalServer, path: str, method: str = "GET", **headers: str) -> Any:
    """Status, headers and text of an answer."""
    connection = http.client.HTTPConnection(HOST, server.port, timeout=10)
    connection.request(method, path, headers={k.replace("_", "-"): v for k, v in headers.items()})
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
