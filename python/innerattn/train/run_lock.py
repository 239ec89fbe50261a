"""One training at a time in a run folder."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from innerattn.errors import RunError, cannot_lock

if sys.platform != "win32":
    import fcntl

_log = logging.getLogger(__name__)


@contextmanager
def only_training_in(run: Path) -> Iterator[None]:
    """Keep other trainings out of a run folder.

    On Windows, and on a file system without locks, nothing keeps them out; of the latter a warning
    tells.

    The lock is that of the open folder. It ends with the process, however that ends.

    Raises:
        RunError: another process trains in it, there is no such folder, or it cannot be locked.
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
        except OSError as error:
            if not cannot_lock(error):
                raise RunError(f"{run}: cannot be locked ({error.strerror})") from error
            text = "innerattn: warning: %s: its file system has no locks (%s); train in it but once"
            _log.warning(text, run, error.strerror)
        yield
    finally:
        os.close(folder)
