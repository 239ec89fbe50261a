"""`innerattn play`: the command serves a page, ends with Ctrl-C, and refuses wrong use."""

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from innerattn.cli.main import main


def posted(address: str, path: str, message: object) -> tuple[int, dict[str, object]]:
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.netloc, timeout=30)
    body, kind = json.dumps(message), {"Content-Type": "application/json"}
    connection.request("POST", parts.path + path, body, kind)
    answer = connection.getresponse()
    found = answer.status, json.loads(answer.read())
    connection.close()
    return found


@pytest.mark.long
@pytest.mark.usefixtures("interruptible")
def test_a_run_is_played(run_dir: Path) -> None:
    command = [sys.executable, "-m", "innerattn", "play", str(run_dir), "oracle", "--seed", "3"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        address = process.stdout.readline().split()[-1]
        status, opened = posted(address, "sessions", {})
        assert status == 200
        scripts = ["oracle", "random", "greedy", "hungarian", "planner", "greedy-seen"]
        assert opened["policies"] == [run_dir.name, *scripts]
        assert opened["attention"]
        for name in ("oracle", run_dir.name, "random"):
            path = f"sessions/{opened['session']}"
            assert posted(address, path, {"do": "policy", "name": name})[0] == 200
            status, state = posted(address, path, {"do": "step"})
            assert (status, state["policy"]) == (200, name)
        assert state["step"] == 3
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 0
        process.stdout.close()


def test_wrong_use(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other.toml"
    other.write_text("max_victims = 5\n")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        nobody = (
            "nobody: neither a run's folder nor one of random, greedy, hungarian, planner, oracle, "
            "greedy-seen"
        )
        cases = [
            (1, ["nobody"], nobody),
            (1, ["greedy", "nobody"], nobody),
            (2, ["greedy", "oracle", "random"], "3 policies: must be 1 or 2 of RUN|POLICY"),
            (1, [str(tmp_path)], f"{tmp_path}/run.json: missing"),
            (2, ["greedy", "--port", "70000"], "--port 70000: must be 0 to 65,535"),
            (2, ["greedy", "--seed", "-1"], "--seed -1: must be 0 to 2**64 - 1"),
            (2, ["greedy", "--spare", "64"], "--spare 64: must be 0 to 63"),
            (1, ["zoo:mixed", "--spare", "2"], "acts in teams of 4 robots alone"),
            (1, ["greedy", "--port", port], f"--port {port}: is taken"),
            (1, ["greedy", "--scenario", "none.toml"], "none.toml"),
            (1, [str(run_dir), "--scenario", str(other)], "was trained for other observations"),
        ]
        for code, options, message in cases:
            assert main(["play", *options]) == code, options
            captured = capsys.readouterr()
            assert message in captured.err
            assert captured.err.count(os.linesep) == 1
            assert not captured.out
