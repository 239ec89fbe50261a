"""Errors in one line: which file, why, and first of all that memory was lacking."""

import errno
import os
import subprocess
import sys

import pytest

from innerattn.errors import needs_no_traceback, one_line

FULL = os.strerror(errno.ENOSPC)
ERRORS = {
    "a file": (OSError(errno.ENOSPC, FULL, "run/run.json"), f"run/run.json: {FULL}"),
    "no file": (OSError(errno.ENOSPC, FULL), FULL),
    "two files": (OSError(errno.ENOSPC, FULL, "a", None, "b"), f"a -> b: {FULL}"),
    "a text": (OSError("the disk is gone"), "the disk is gone"),
    "memory": (MemoryError(), "out of memory"),
    "memory of the system": (OSError(errno.ENOMEM, "no"), "out of memory: no"),
    "memory of code in C": (
        SystemError("error return without exception set"),
        "out of memory: error return without exception set",
    ),
    "a library": (
        ImportError("libtorch_cpu.so: failed to map segment from shared object"),
        "out of memory: libtorch_cpu.so: failed to map segment from shared object",
    ),
}


@pytest.mark.parametrize("what", ERRORS)
def test_an_error_is_one_line(what: str) -> None:
    error, text = ERRORS[what]
    assert one_line(error) == text
    assert needs_no_traceback(error)


def test_another_fault_of_the_system_is_told_in_full() -> None:
    assert not needs_no_traceback(SystemError("bad argument to internal function"))


def test_a_second_file_that_was_taken_away_is_not_named() -> None:
    error = OSError(errno.ENOSPC, FULL, "a", None, "b")
    error.filename2 = None
    assert one_line(error) == f"a: {FULL}"


LIMITED = """
import resource, sys
limit = int(sys.argv[1]) << 20
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
from innerattn.cli.start import main
sys.exit(main(["train", "--train.env-steps", "512", "--run-dir", sys.argv[2]]))
"""


@pytest.mark.parametrize("megabytes", [150, 300, pytest.param(600, marks=pytest.mark.long)])
def test_no_lack_of_memory_ends_in_a_traceback(
    megabytes: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("limited") / "run"
    command = [sys.executable, "-c", LIMITED, str(megabytes), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert "Traceback" not in done.stderr, done.stderr
    assert done.returncode == 0 or done.stderr  # OpenBLAS ends the process with a line of its own
