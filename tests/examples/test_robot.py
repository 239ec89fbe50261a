"""The robot loop in examples/: processes that talk over sockets drive a world."""

import json
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

STEPS = 8


@pytest.fixture
def export(plain_team: Path) -> Path:
    return plain_team / "export"


@pytest.fixture
def robot(imported: Callable[[str], ModuleType]) -> ModuleType:
    imported("robot")
    return import_module("robot.hardware")


def drive(robot: ModuleType, export: Path, **link: float) -> object:
    settings = robot.Drive(export, episodes=2, episode_steps=STEPS, scale=0.5, backend="numpy")
    return robot.drive(settings, robot.LinkSettings(**link))


def test_four_processes_drive_a_world(robot: ModuleType, export: Path) -> None:
    found = drive(robot, export)
    assert found.commands + found.late == 2 * STEPS * 4
    assert found.commands > 0
    assert found.heard > 0
    assert (found.episodes, found.teammates) == (2, 3)


def test_who_loses_every_message_hears_nobody(robot: ModuleType, export: Path) -> None:
    found = drive(robot, export, loss=1.0)
    assert found.commands > 0
    assert found.heard == 0


def test_clocks_too_far_apart_are_as_good_as_no_link(robot: ModuleType, export: Path) -> None:
    found = drive(robot, export, skew_s=1000.0)
    assert found.commands > 0
    assert found.heard == 0


@pytest.mark.usefixtures("robot")
def test_messages_are_late_and_lost_as_the_seed_says() -> None:
    from robot.link import LinkSettings, LossyLink, open_socket, received

    def arrived(seed: int, loss: float) -> list[int]:
        link, peer = LossyLink(LinkSettings(0.05, loss), seed), open_socket()
        for number in range(40):
            link.send({"number": number}, [peer.getsockname()[1]], now=0.1 * number)
        assert link.next_due == (None if loss == 1.0 else pytest.approx(3.95)) or loss == 0.3
        link.flush(3.9499)
        link.socket.close()
        found = [message["number"] for message in received(peer)]
        peer.close()
        return found

    assert arrived(1, 0.0) == list(range(39))  # the last is still on its way
    assert arrived(1, 1.0) == []
    some = arrived(1, 0.3)
    assert 15 < len(some) < 39
    assert some == arrived(1, 0.3) != arrived(2, 0.3)


def test_the_command_says_what_is_wrong(export: Path, tmp_path: Path) -> None:
    example = Path(__file__).parents[2] / "examples" / "robot"
    contract = json.loads((export / "contract.json").read_text())
    assert contract["control_period_s"] == 0.1
    cases = [([str(tmp_path / "none")], 1, "no such folder"), ([], 2, "required: export")]
    for options, code, message in cases:
        done = subprocess.run(
            [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(example)!r}); "
             "import runpy; runpy.run_module('robot', run_name='__main__')", "run", *options],
            capture_output=True,
            text=True,
            check=False,
        )  # fmt: skip
        assert done.returncode == code
        assert message in done.stderr
        assert "Traceback" not in done.stderr
