"""The soak finds what grows, and nothing where nothing does."""

import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from soak import soak_worlds, soaked, state

from innerattn.envs import BatchEnv

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def test_memory_threads_and_files_that_stay_are_told(tmp_path: Path) -> None:
    warm = state()
    less = replace(warm, resident_bytes=warm.resident_bytes // 2)
    go_on = threading.Event()
    waiting = threading.Thread(target=go_on.wait)
    with (tmp_path / "file").open("w"):
        waiting.start()
        found = soaked("x", 1, time.perf_counter(), less, ("a problem",))
    go_on.set()
    waiting.join()
    problem, memory, threads, files = found.problems
    assert problem == "a problem"
    assert memory.startswith("memory grew by ")
    assert threads == "1 threads more than after the warm-up"
    assert files == "1 open files more than after the warm-up"
    assert found.growth > 0.5


@pytest.mark.parametrize("engine", ["discs", "rapier"])
def test_worlds_leave_nothing_behind(engine: str) -> None:
    found = soak_worlds(engine, 200 * 1024)
    assert found.env_steps == 200 * 1024
    assert not [one for one in found.problems if not one.startswith("memory")]


def test_what_is_wrong_in_a_world_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    positions = BatchEnv.positions
    monkeypatch.setattr(BatchEnv, "positions", lambda env: positions(env) + np.float32(3.0))
    found = soak_worlds("discs", 100 * 1024)
    assert "step 0: a robot is outside the arena" in found.problems
