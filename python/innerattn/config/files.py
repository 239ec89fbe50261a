"""Finding presets, reading TOML with errors that name the file, writing files whole.

It knows no key of any model.
"""

from __future__ import annotations

import errno
import os
import secrets
import tomllib
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from innerattn.config.near import did_you_mean
from innerattn.config.untrusted import MOST_TOML_BYTES, read_plain
from innerattn.config.untrusted_toml import parse_toml
from innerattn.errors import ConfigError, RunError

PRESETS = files("innerattn.config") / "presets"
"""Folder of the built-in presets."""


def preset_names(folder: str) -> tuple[str, ...]:
    """Names of the presets in ``folder`` ("scenarios" or "budgets"), sorted."""
    entries = (entry.name for entry in (PRESETS / folder).iterdir())
    return tuple(sorted(name[:-5] for name in entries if name.endswith(".toml")))


def preset_table(folder: str, name: str) -> dict[str, Any]:
    """The table of the preset ``name`` in ``folder``.

    Raises:
        ConfigError: no such preset; the message names the known ones.
    """
    known = preset_names(folder)
    if name not in known:
        what = folder.removesuffix("s")
        is_file = what == "scenario" and name.endswith(".toml")
        raise ConfigError(
            f"unknown {what} preset {name!r}: known are {', '.join(known)}"
            + ("; Scenario.from_toml reads a file" if is_file else did_you_mean(name, known, repr))
        )
    return tomllib.loads((PRESETS / folder / f"{name}.toml").read_text("utf-8"))


def budget_table(folder: Traversable | None, budget: str) -> dict[str, Any]:
    """What an algorithm changes in a budget: the table in ``folder``, or nothing without a file."""
    file = folder / f"{budget}.toml" if folder is not None else None
    return tomllib.loads(file.read_text("utf-8")) if file is not None and file.is_file() else {}


def toml_table(path: str | Path) -> dict[str, Any]:
    """The table in the TOML file at ``path``.

    Raises:
        ConfigError: the file cannot be read, is no plain file, or is not TOML.
    """
    try:
        if not os.path.exists(path):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        data = read_plain(Path(path), MOST_TOML_BYTES, follow_link=True)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from error
    except RunError as error:
        raise ConfigError(str(error)) from error
    return toml_table_in(data, path)


def toml_table_in(data: bytes, path: str | Path) -> dict[str, Any]:
    """The table in the bytes of the TOML file at ``path``.

    Raises:
        ConfigError: they are not TOML.
    """
    try:
        return parse_toml(data.decode("utf-8"))
    except ValueError as error:
        raise ConfigError(f"{path} is not a TOML file: {error}") from error


def write_whole(path: Path, data: bytes) -> None:
    """Put ``data`` at ``path``; a reader sees the old file or the new one, never a part.

    Raises:
        OSError: the file cannot be written; no partial file is left.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(8)}")
    try:
        # "x": a file or link that somebody planted there is never written to.
        with open(partial, "xb", opener=_no_link) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    except BaseException as error:
        partial.unlink(missing_ok=True)
        if isinstance(error, OSError):  # the user knows no partial file
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
    sync_folder(path.parent)


def write_in_place(path: Path, data: bytes) -> None:
    """Put ``data`` over the small file at ``path``, where a full disk has no room for a new one.

    A loss of power in the midst of it may damage the file.

    Raises:
        OSError: there is no such file, it is a link, or there is no room for all of ``data``; the
            file is as it was.
    """
    descriptor = os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    with os.fdopen(descriptor, "r+b", buffering=0) as file:
        before = file.read()
        file.seek(0)
        written = file.write(data)
        if written < len(data):
            file.seek(0)
            file.write(before[:written])
            file.truncate(len(before))
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        file.truncate()


def sync_folder(folder: Path) -> None:
    """Let the names in a folder outlast a loss of power, where the system can.

    Raises:
        OSError: it cannot be done.
    """
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        unable = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EBADF)
        if error.errno not in unable:  # not every file system can
            raise OSError(error.errno, error.strerror, str(folder)) from error
    finally:
        os.close(descriptor)


def _no_link(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)
