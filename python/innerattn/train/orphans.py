"""Run folders that were being made when their process was killed: found and removed.

A folder is made as ``.NAME.PID`` and then renamed; see `innerattn.train.checkpoint.RunFolder`. Its
process holds a lock on it for as long. On Windows there is no such lock, and nothing is removed.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from innerattn.train.run_lock import FolderLock

_NAME = re.compile(r"\..+\.([1-9][0-9]{0,9})")
_FILE = re.compile(r"config\.toml|run\.json|\.(config\.toml|run\.json)\.[0-9]+\.[0-9a-f]{16}")


def name_while_made(path: Path) -> Path:
    """Where the run folder ``path`` lies while this process makes it."""
    return path.with_name(f".{path.name}.{os.getpid()}")


@contextmanager
def being_made(folder: Path) -> Iterator[None]:
    """Make a folder that no other process takes for an orphan inside the block.

    If the block raises, the folder is removed.

    Raises:
        OSError: it cannot be made, or not locked though its file system has locks.
    """
    folder.mkdir()
    try:
        lock = FolderLock(folder)
        try:
            yield
        finally:
            lock.release()
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def sweep_orphans(parent: Path) -> None:
    """Remove from a folder what processes left that were killed while they made a run folder.

    What a living process makes stays, and so does everything that making a run does not write. What
    cannot be removed stays too, without an error.
    """
    if sys.platform == "win32":
        return
    with suppress(OSError):
        for entry in list(parent.iterdir()):
            found = _NAME.fullmatch(entry.name)
            if found and not entry.is_symlink() and entry.is_dir():
                process = int(found[1])
                # This process makes nothing yet: what has its number is of one before it.
                if process == os.getpid() or not _lives(process):
                    _remove_if_orphan(entry)


def _remove_if_orphan(folder: Path) -> None:
    with suppress(OSError):
        lock = FolderLock(folder)
        try:
            if lock.refused is None and _is_ours(folder):
                shutil.rmtree(folder)  # never through a symbolic link
        finally:
            lock.release()


def _is_ours(folder: Path) -> bool:
    """Whether a folder holds nothing but what the making of a run writes."""
    for entry in folder.iterdir():
        if entry.is_symlink():
            return False
        if entry.is_dir():
            if entry.name != "checkpoints" or any(entry.iterdir()):
                return False
        elif not (entry.is_file() and _FILE.fullmatch(entry.name)):
            return False
    return True


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is another user's
        return True
    return True
