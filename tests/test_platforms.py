"""What only POSIX systems have is not needed to start, nor to run side by side."""

import subprocess
import sys
from pathlib import Path

import pytest

WITHOUT_POSIX = """
import os, signal, sys
for name in ("fcntl", "resource", "termios", "pwd", "grp"):
    sys.modules[name] = None
for name in ("SIGHUP", "SIGKILL", "SIGUSR1", "pthread_sigmask"):
    delattr(signal, name)
"""


def python(code: str, *arguments: object, folder: Path) -> str:
    """What a program prints that is run as a file, so that processes can be spawned from it."""
    file = folder / "program.py"
    file.write_text(code)
    command = [sys.executable, str(file), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_commands_start_without_posix(tmp_path: Path) -> None:
    code = """
import multiprocessing.reduction, types
import numpy, pettingzoo, pyarrow.parquet, pydantic, rich.progress, scipy.stats, tyro
sys.modules["msvcrt"] = types.SimpleNamespace()
sys.platform = "win32"
import innerattn.cli.main, innerattn.cli.study, innerattn.experiments.side_by_side
print("started")
"""
    assert python(WITHOUT_POSIX + code, folder=tmp_path) == "started\n"


@pytest.mark.long
def test_runs_go_side_by_side_where_signals_cannot_be_blocked(tmp_path: Path) -> None:
    code = """
import signal
for name in ("SIGHUP", "pthread_sigmask"):
    delattr(signal, name)

import sys
from pathlib import Path
from innerattn.config import RunConfig
from innerattn.experiments.side_by_side import Run
from innerattn.experiments.processes import run_side_by_side

if __name__ == "__main__":
    run = Run(RunConfig(), Path(sys.argv[1]) / "none", trained=True)
    run_side_by_side([run], 1, changed=lambda _: None, failed=lambda run: print(run.failure))
"""
    expected = f"{tmp_path / 'none'}: no such run folder\n"
    assert python(code, tmp_path, folder=tmp_path) == expected
