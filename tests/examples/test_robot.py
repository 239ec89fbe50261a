"""The robot loop in examples/: processes that talk over sockets drive a world."""

import json
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from made_export import made_export

from innerattn.config import RangeSensor, Scenario
from innerattn.policies import Exported

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


@pytest.fixture(scope="module")
def rovers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A team on wheels whose cameras look ahead, with rays, of which nobody hears all."""
    sensor = RangeSensor(rays=5, range_m=0.8, field_of_view_deg=180.0)
    robots = [
        robot.replace(drive=drive, field_of_view_deg=200.0, range_sensor=sensor)
        for robot, drive in zip(Scenario().robots, 2 * ["unicycle", "differential"], strict=True)
    ]
    values = {
        "scenario.robots": [robot.model_dump() for robot in robots],
        "scenario.communication": {"share": "victims", "range_m": 1.0},
    }
    return made_export(tmp_path_factory.mktemp("rovers"), "ppo-inner", **values)[1]


@pytest.mark.long
def test_what_robots_on_wheels_sense_makes_the_rows_of_their_world(
    robot: ModuleType, rovers: Path
) -> None:
    from robot.member import OWN_ALONE
    from robot.senses import sensed

    team = Exported(rovers, backend="numpy")
    env = robot.Drive(rovers, seed=3).world(team)
    rng = np.random.default_rng(0)
    heard_less = 0
    for _ in range(20):
        obs = env.step(rng.integers(0, 5, (1, 4))).obs[0]
        found = [sensed(env, team, index) for index in range(4)]
        told = {
            name: {key: one for key, one in each["own"].items() if key not in OWN_ALONE}
            for name, each in zip(team.robot_names, found, strict=True)
        }
        for index, name in enumerate(team.robot_names):
            unseen = found[index].pop("unseen")
            heard = [team.robot_names[other] for other in np.flatnonzero(env.heard()[0, index])]
            heard_less += len(heard) < 3
            teammates = {other: told[other] for other in told if other != name}
            teammates |= {
                other: None if since is None else {"since_seen": since}
                for other, since in unseen.items()
            }
            row = team.row(name, {**found[index], "teammates": teammates, "heard": heard})
            np.testing.assert_allclose(row, obs[index], atol=2e-6)
    assert heard_less


@pytest.mark.long
def test_processes_drive_robots_on_wheels(robot: ModuleType, rovers: Path) -> None:
    found = drive(robot, rovers, latency_s=0.05, loss=0.2)
    assert found.commands > 0
    assert 0 < found.heard < 3 * found.commands


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
