"""Runs the code of pages in the Node.js that Playwright brings."""

import os
import subprocess
from pathlib import Path

import playwright

_NODE = Path(playwright.__file__).parent / "driver" / ("node.exe" if os.name == "nt" else "node")


def run_in_node(code: str, *args: object, told: str = "", seconds: float = 60.0) -> bytes:
    """What a program writes to its standard output.

    Args:
        code: the program.
        args: what it finds in ``process.argv``, from 1 on.
        told: its standard input.
        seconds: how long it may take.
    """
    done = subprocess.run(
        [str(_NODE), "-e", code, *map(str, args)],
        input=told.encode(),
        capture_output=True,
        timeout=seconds,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout
