"""Two versions of the package beside each other, each in a process of its own, asked in turn."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


class Version:
    """A process that answers lines on its input, with one version of the package.

    Args:
        script: the benchmark, which answers when it is called with ``--measure``.
        python: `PYTHONPATH` of the version.
    """

    def __init__(self, script: str, python: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, script, "--measure"],
            env=os.environ | {"PYTHONPATH": str(python)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, *words: object) -> str:
        """Its answer to a line of words."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(" ".join(map(str, words)) + "\n")
        self._process.stdin.flush()
        return self._process.stdout.readline().strip()


def older_and_now(script: str) -> tuple[Version, Version]:
    """The version whose `PYTHONPATH` is the script's only argument, and that of this checkout.

    Raises:
        SystemExit: there is no such argument.
    """
    if len(sys.argv) != 2:
        sys.exit(f"usage: python {sys.argv[0]} FOLDER")
    return Version(script, Path(sys.argv[1])), Version(script, Path(script).parents[1] / "python")
