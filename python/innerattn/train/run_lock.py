"""One training at a time in a run folder."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from innerattn.errors import RunError

if sys.platform != "win32":
    import fcntl


@contextmanager
def only_training_in(run: Path) -> Iterator[None]:
    """Keep other trainings out of a run folder; on Windows nothing keeps them out.

    The lock is that of the open folder. It ends with the process, however that ends.

    Raises:
        RunError: another process trains in it, or there is no such folder.
    """
    if sys.platform == "win32":
        yield
        return
    try:
        folder = os.open(run, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise RunError(f"{run}: no such run folder") from error
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RunError(f"{run}: another process is training in it") from error
        yield
    finally:
        os.close(folder)
