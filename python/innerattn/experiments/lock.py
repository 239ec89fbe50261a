"""One study at a time in a folder, so that no run is trained twice."""

from __future__ import annotations

import logging
import os
import sys
from multiprocessing import reduction
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from innerattn.errors import RunError, cannot_lock

if sys.platform == "win32":
    import msvcrt

    def _lock(file: int) -> None:
        """Lock an open file, or raise an OSError where another has it."""
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: int) -> None:
        """Lock an open file, or raise an OSError where another has it."""
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


_log = logging.getLogger(__name__)
_NOFOLLOW = getattr(os, "O_NOFOLLOW", 0)


class StudyLock:
    """Keeps others out of a study's folder; a context manager.

    A process that is started with the lock as an argument holds it too, until it ends: where a
    study is killed, its runs end a little later, and only then may the next study remove them. On
    Windows only the process that took the lock holds it.
    """

    def __init__(self, file: int) -> None:
        """Hold the lock of an open file; `take` opens one."""
        self._file = file

    @classmethod
    def take(cls, out: Path) -> Self:
        """Lock the folder ``out``, which is made if needed.

        Raises:
            RunError: another study is at work there, or the folder or its lock cannot be made.
        """
        try:
            out.mkdir(parents=True, exist_ok=True)
            file = os.open(out / ".lock", os.O_RDWR | os.O_CREAT | _NOFOLLOW, 0o644)
        except OSError as error:
            raise RunError(f"{out}: cannot hold a study ({error.strerror})") from error
        try:
            _lock(file)
        except OSError as error:
            if cannot_lock(error):
                text = (
                    "innerattn: warning: %s: its file system has no locks (%s); run one study in it"
                )
                _log.warning(text, out, error.strerror)
                return cls(file)
            os.close(file)
            if not isinstance(error, BlockingIOError | PermissionError):
                raise RunError(f"{out}: cannot be locked ({error.strerror})") from error
            raise RunError(
                f"{out}: another study is at work here, or its last runs are still ending; "
                "wait for it, or choose another folder"
            ) from error
        return cls(file)

    def __enter__(self) -> Self:
        """Hold the lock."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Let others in, once the processes that were started with it are gone too."""
        os.close(self._file)

    def __reduce__(self) -> tuple[Any, ...]:
        """For a process that is being started: the same open file, and with it the same lock."""
        if sys.platform == "win32":
            return StudyLock, (os.open(os.devnull, os.O_RDONLY),)
        return _handed_down, (reduction.DupFd(self._file),)


def _handed_down(duplicate: Any) -> StudyLock:
    file: int = duplicate.detach()
    os.set_inheritable(file, False)
    return StudyLock(file)  # open to the end of the process, whatever becomes of the object
