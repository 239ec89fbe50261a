"""One study at a time in a folder, so that no run is trained twice."""

from __future__ import annotations

import fcntl
import os
from multiprocessing import reduction
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from innerattn.errors import RunError


class StudyLock:
    """Keeps others out of a study's folder; a context manager.

    A process that is started with the lock as an argument holds it too, until it ends: where a
    study is killed, its runs end a little later, and only then may the next study remove them.
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
            file = os.open(out / ".lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        except OSError as error:
            raise RunError(f"{out}: cannot hold a study ({error.strerror})") from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(file)
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
        return _handed_down, (reduction.DupFd(self._file),)


def _handed_down(duplicate: Any) -> StudyLock:
    file: int = duplicate.detach()
    os.set_inheritable(file, False)
    return StudyLock(file)  # open to the end of the process, whatever becomes of the object
