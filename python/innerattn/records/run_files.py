"""The files of a run folder: sealed by a manifest of their digests, and read whole, once, checked.

`manifest.json` holds the SHA-256 and size of every file, and ``run.json`` says that it is there.
A reader gets the very bytes whose digest was compared. The manifest finds damage, mixed-up files
and edits of single files; whoever can write the folder can write another manifest, too.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from innerattn.config.files import write_whole
from innerattn.config.untrusted import parse_json, read_plain
from innerattn.errors import RunError, UnsealedRunWarning
from innerattn.records.run_info import RunInfo, run_info
from innerattn.zoo import run_path

MANIFEST = "manifest.json"
_SCHEMA_VERSION = 1
_MOST_FILES = 100_000
_MOST_MANIFEST_BYTES = 32 << 20
_MOST_INFO_BYTES = 1 << 20
_CHUNK_BYTES = 1 << 20
_ROWS = "checkpoints/rows/"
"""Large files whose digests are in the checkpoints that need them."""
_DIGITS = frozenset("0123456789abcdef")


class AlteredFileError(RunError):
    """A file of a run is not the one that was sealed."""


@dataclass(frozen=True)
class _Entry:
    sha256: str
    bytes: int


class RunFiles:
    """A run folder that is being read: its ``run.json``, and any other file by its name.

    Attributes:
        path: the folder, or a link to it.
        info: the contents of ``run.json``.
    """

    def __init__(self, run: str | Path) -> None:
        """Read ``run.json`` and the manifest of a run, named by its folder or as ``zoo:NAME``.

        Warns:
            UnsealedRunWarning: the run is over and has no manifest.

        Raises:
            RunError: there is no such folder, it was not made by training, or ``run.json`` or the
                manifest is missing, damaged or not of this run.
        """
        self.path = run_path(run)
        if not self.path.is_dir():
            raise RunError(f"{self.path}: no such run folder")
        file = self.path / "run.json"
        data = _read(file, _MOST_INFO_BYTES)
        try:
            document = parse_json(data)
        except ValueError as error:
            raise RunError(f"{file}: not the record of a run") from error
        try:
            self.info = run_info(document)
        except ValueError as error:
            raise RunError(f"{file}: {error}") from error
        self._entries = _manifest(self.path) if self.info.sealed else None
        if self._entries is not None:
            _check(file, "run.json", data, self._entries)
        elif self.info.state != "running":
            text = f"{self.path}: has no {MANIFEST}; its files are read unchecked"
            # From one place, so that Python shows it once for each run.
            warnings.warn(text, UnsealedRunWarning, stacklevel=1)

    def read(self, name: str, most_bytes: int) -> bytes:
        """The bytes of a file, whose digest the manifest knows.

        Args:
            name: its path in the folder, with "/" between parts.
            most_bytes: how long it may be.

        Raises:
            RunError: it is missing, no plain file, reached through a link, or too long.
            AlteredFileError: it is not the one that was sealed.
        """
        file = self.path
        for part in PurePosixPath(name).parts:
            if file != self.path and (file.is_symlink() or not file.is_dir()):
                raise RunError(f"{file}: missing, or not a plain folder")
            file = file / part
        data = _read(file, most_bytes)
        if self._entries is not None:
            _check(file, name, data, self._entries)
        return data


@contextmanager
def unsealed(run: Path) -> Iterator[None]:
    """Inside the block, a run whose manifest was removed counts as one that never had any.

    Where the block fails, ``run.json`` is as it was: it says that there must be a manifest.

    Raises:
        RunError: ``run.json`` is missing or damaged.
        OSError: it cannot be written.
    """
    file = run / "run.json"
    if (run / MANIFEST).exists() or not file.exists():
        yield
        return
    data = _read(file, _MOST_INFO_BYTES)
    try:
        info = run_info(parse_json(data))
    except ValueError:  # who reads it says what is wrong
        yield
        return
    if not info.sealed:
        yield
        return
    write_whole(file, info_text(replace(info, sealed=False)))
    try:
        yield
    except BaseException:
        write_whole(file, data)
        raise


def seal(run: Path, info: RunInfo) -> RunInfo:
    """Write the digests of all files of a run, then ``run.json`` with ``sealed`` set.

    Returns:
        What ``run.json`` says now.

    Raises:
        OSError: a file cannot be read or written.
        RunError: there are more than 100,000 files.
    """
    sealed = replace(info, sealed=True)
    data = info_text(sealed)
    entries = {name: _entry_of(run / name) for name in _names(run)}
    entries["run.json"] = _Entry(hashlib.sha256(data).hexdigest(), len(data))
    _write_manifest(run, entries)
    write_whole(run / "run.json", data)
    return sealed


def amend(run: Path, folder: str) -> None:
    """Write the digests of the files in a folder of a sealed run anew; leave all others alone.

    A run that is not sealed, and a folder that is no run, are left as they are.

    Raises:
        RunError: its ``run.json`` or manifest is damaged.
        OSError: a file cannot be read or written.
    """
    if not (run / "run.json").is_file():
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnsealedRunWarning)
        files = RunFiles(run)
    if files._entries is None:
        return
    inside = f"{folder}/"
    entries = {name: one for name, one in files._entries.items() if not name.startswith(inside)}
    entries |= {name: _entry_of(run / name) for name in _names(run) if name.startswith(inside)}
    _write_manifest(run, entries)


def info_text(info: RunInfo) -> bytes:
    """The bytes of ``run.json``."""
    return (json.dumps(asdict(info), indent=1) + "\n").encode()


def _read(file: Path, most_bytes: int) -> bytes:
    try:
        return read_plain(file, most_bytes)
    except OSError as error:
        raise RunError(f"{file}: cannot be read ({error.strerror})") from error


def _check(file: Path, name: str, data: bytes, entries: dict[str, _Entry]) -> None:
    entry = entries.get(name)
    if entry is None:
        raise AlteredFileError(f"{file}: is not in the run's {MANIFEST}")
    if entry != _Entry(hashlib.sha256(data).hexdigest(), len(data)):
        raise AlteredFileError(f"{file}: is not the file that {MANIFEST} names; it was altered")


def _manifest(run: Path) -> dict[str, _Entry]:
    file = run / MANIFEST
    data = _read(file, _MOST_MANIFEST_BYTES)
    try:
        document = parse_json(data)
        version, table, digest = (document[key] for key in ("schema_version", "files", "sha256"))
        entries = {name: _Entry(one["sha256"], one["bytes"]) for name, one in table.items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{file}: not a manifest of a run ({error})") from error
    if version != _SCHEMA_VERSION:
        raise RunError(f"{file}: schema version {version}, only {_SCHEMA_VERSION} is known")
    if data != _manifest_text(entries) or digest != _digest(entries):
        raise RunError(f"{file}: does not fit its own digest; it was altered")
    for name, entry in entries.items():
        if not (isinstance(entry.sha256, str) and set(entry.sha256) <= _DIGITS):
            raise RunError(f"{file}: the digest of {name!r} is none")
    return entries


def _digest(entries: dict[str, _Entry]) -> str:
    table = {name: asdict(entry) for name, entry in sorted(entries.items())}
    return hashlib.sha256(json.dumps(table).encode()).hexdigest()


def _manifest_text(entries: dict[str, _Entry]) -> bytes:
    document: dict[str, Any] = {
        "schema_version": _SCHEMA_VERSION,
        "files": {name: asdict(entry) for name, entry in sorted(entries.items())},
        "sha256": _digest(entries),
    }
    return (json.dumps(document, indent=1) + "\n").encode()


def _write_manifest(run: Path, entries: dict[str, _Entry]) -> None:
    write_whole(run / MANIFEST, _manifest_text(entries))


def _names(run: Path) -> Iterable[str]:
    """Names of the plain files in a run folder; no link.

    Those that are written last are left out, and those that checkpoints hold the digests of.
    """
    names = []
    for folder, _, files in os.walk(run):  # does not follow links
        for file in files:
            path = Path(folder, file)
            name = path.relative_to(run).as_posix()
            partial = file.startswith(".")
            elsewhere = name in (MANIFEST, "run.json") or name.startswith(_ROWS)
            if not partial and not elsewhere and _is_plain(path):
                names.append(name)
    if len(names) > _MOST_FILES:
        raise RunError(f"{run}: has {len(names)} files: must have at most {_MOST_FILES}")
    return names


def _is_plain(path: Path) -> bool:
    return stat.S_ISREG(path.lstat().st_mode)


def _entry_of(path: Path) -> _Entry:
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while part := file.read(_CHUNK_BYTES):
            digest.update(part)
            size += len(part)
    return _Entry(digest.hexdigest(), size)
