"""The soak finds what grows, and nothing where nothing does."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reliability_kept import read
from reliability_rows import ROWS
from soak import Soaked, State, Watched, main, result_of, soak_worlds, state

from innerattn.envs import BatchEnv

BENCHES = Path(__file__).parents[2] / "benches"
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


LEAK = """
import json, sys, threading
from dataclasses import asdict
import numpy as np
from soak import Watched, state
watched, go_on = Watched(), threading.Event()
waiting = threading.Thread(target=go_on.wait)
for share in (0.0, 0.1, 0.5):
    watched.look(share)
with open(sys.argv[1], "w"):
    waiting.start()
    held = np.ones(state().resident_bytes, np.uint8)
    watched.look(0.95)
go_on.set()
waiting.join()
print(json.dumps(asdict(watched.soaked("x", 1, ["a problem"]))))
"""
"""Keeps memory, a thread and a file, and prints what is said of that."""


@pytest.mark.long
def test_memory_threads_and_files_that_stay_are_told(tmp_path: Path) -> None:
    # In a process of its own: here, a thread or a file of an earlier test may end meanwhile.
    command = [sys.executable, "-c", LEAK, str(tmp_path / "file")]
    done = subprocess.run(command, cwd=BENCHES, check=True, capture_output=True, text=True)
    told = json.loads(done.stdout)
    warm, end = (State(**told.pop(when)) for when in ("warm", "end"))
    found = Soaked(**{**told, "problems": tuple(told["problems"])}, warm=warm, end=end)
    problem, memory, threads, files = found.problems
    assert problem == "a problem"
    kept, told = result_of(found), result_of(replace(found, problems=()))
    assert kept.notes[0] == f"X: 1 env-steps, memory {found.growth:+.2%}."
    assert (told.passed, told.failed, len(told.notes)) == (1, 0, 1)
    assert (kept.passed, kept.failed, len(kept.notes)) == (0, 1, 5)
    assert memory.startswith("memory grew by ")
    assert threads == "1 threads more than after the warm-up"
    assert files == "1 open files more than after the warm-up"
    assert found.growth > 0.5


@pytest.mark.parametrize("engine", ["discs", "rapier"])
def test_worlds_leave_nothing_behind(engine: str) -> None:
    found = soak_worlds(engine, 200 * 1024)
    assert found.env_steps == 200 * 1024
    assert not [one for one in found.problems if not one.startswith("memory")]


def test_what_is_borrowed_and_given_back_is_no_growth(tmp_path: Path) -> None:
    watched = Watched()
    watched.look(0.1)
    with (tmp_path / "file").open("w"):
        watched.look(0.9)
    watched._looked -= 1.0  # a second ago
    watched.look(1.0)
    assert "1 open files more than after the warm-up" not in watched.soaked("x", 1).problems


def test_what_is_wrong_in_a_world_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    positions = BatchEnv.positions
    monkeypatch.setattr(BatchEnv, "positions", lambda env: positions(env) + np.float32(3.0))
    found = soak_worlds("discs", 100 * 1024)
    assert "step 0: a robot is outside the arena" in found.problems


def test_only_work_in_full_is_kept_part_by_part(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "kept.json"
    some = Soaked("x", 1, 1.0, state(), state(), 0.0, ())

    def fails(minutes: float) -> Soaked:
        assert minutes == 60.0
        return replace(some, problems=("it grew",))

    monkeypatch.setattr("soak.FILE", file)
    monkeypatch.setattr("soak.publish", lambda *_: None)
    monkeypatch.setattr("soak.soak_worlds", lambda *_: some)
    monkeypatch.setattr("soak.soak_training", lambda _: some)
    monkeypatch.setattr("sys.argv", ["soak.py", "--minutes", "59"])
    assert main() == 0
    assert not file.exists()
    names = [f"benches/soak.py --parts {part}" for part in ("discs", "rapier", "training")]
    monkeypatch.setattr("sys.argv", ["soak.py", "--parts", "discs", "rapier"])
    assert main() == 0
    assert list(read(file)) == names[:2]
    monkeypatch.setattr("soak.soak_training", fails)
    monkeypatch.setattr("sys.argv", ["soak.py", "--parts", "training"])
    assert main() == 1
    assert [read(file)[name].result.failed for name in names] == [0, 0, 1]
    (soak,) = (row for row in ROWS if row.name == "soak")
    assert list(soak.long) == names
