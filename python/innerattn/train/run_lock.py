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

    Raises:
        RunError: another process trains in it, there is no such folder, or it cannot be locked.
    """
    try:
        lock = FolderLock(run)
    except BlockingIOError as error:
        raise RunError(f"{run}: another process is training in it") from error
    except (FileNotFoundError, NotADirectoryError) as error:
        raise RunError(f"{run}: no such run folder") from error
    except OSError as error:
        raise RunError(f"{run}: cannot be locked ({error.strerror})") from error
    try:
        if lock.refused is not None:
            text = "innerattn: warning: %s: its file system has no locks (%s); train in it but once"
            _log.warning(text, run, lock.refused)
        yield
    finally:
        lock.release()


class FolderLock:
    """The lock of an open folder, which keeps its place when the folder gets another name.

    It ends with the process, however that ends. On Windows folders have no locks.

    Attributes:
        refused: why the file system gives no locks; None if it does.
    """

    def __init__(self, folder: Path) -> None:
        """Take the lock.

        Raises:
            BlockingIOError: another process has it.
            OSError: the folder cannot be opened or locked, though its file system has locks.
        """
        self.refused: str | None = None
        self._open: int | None = None
        if sys.platform == "win32":
            return
        self._open = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            fcntl.flock(self._open, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if not cannot_lock(error):
                self.release()
                raise
            self.refused = error.strerror

    def release(self) -> None:
        """Let others have it."""
        if self._open is not None:
            os.close(self._open)
            self._open = None
