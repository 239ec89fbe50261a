"""The rows of a large memory in files: each row is written once, and checkpoints share the files.

The files are written as the memory fills, so that a checkpoint has only the newest rows to write,
whatever the size of the memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from innerattn.config.untrusted import read_plain
from innerattn.errors import RunError
from innerattn.learn.ring import Ring
from innerattn.train.checkpoint_info import RowsInfo, Segment
from innerattn.train.weights import tensors_in, write_weights

FORMAT = "innerattn.rows"
_SEGMENT_BYTES = 8 << 20
"""A file has about as many bytes: written and synchronised in well under a second."""
_HEADER_BYTES = 1 << 20


class RowFiles:
    """The files of one memory."""

    def __init__(self, folder: Path, name: str, ring: Ring, info: RowsInfo | None = None) -> None:
        """Write the rows of ``ring`` to ``folder`` from now on.

        Args:
            folder: is there.
            name: of the memory, in the names of its files.
            ring: the memory.
            info: files that hold what is in the memory already.
        """
        self._folder, self._name, self._ring = folder, name, ring
        self._size = _rows_of_a_file(ring)
        known = info.segments if info is not None else ()
        self._whole = [one for one in known if one.count == self._size]
        self._tail = next((one for one in known[-1:] if one.count < self._size), None)

    def write_whole_files(self) -> None:
        """Write the rows that fill a file.

        Raises:
            OSError: a file cannot be written; a later call writes it.
        """
        while self._ring.seen - self._first_unwritten >= self._size:
            self._whole.append(self._write(self._first_unwritten, self._size))

    def write(self) -> RowsInfo:
        """Write all rows that are not written yet.

        Raises:
            OSError: a file cannot be written.
        """
        self.write_whole_files()
        first, seen = self._first_unwritten, self._ring.seen
        oldest = seen - self._ring.held
        self._whole = [one for one in self._whole if one.first + one.count > oldest]
        if first == seen:
            return RowsInfo(seen, tuple(self._whole))
        if self._tail is None or (self._tail.first, self._tail.count) != (first, seen - first):
            self._tail = self._write(first, seen - first)
        return RowsInfo(seen, (*self._whole, self._tail))

    @property
    def _first_unwritten(self) -> int:
        written = self._whole[-1].first + self._whole[-1].count if self._whole else 0
        return max(written, self._ring.seen - self._ring.held)

    def _write(self, first: int, count: int) -> Segment:
        segment = Segment(first, count, "")
        path = self._folder / file_name(self._name, segment)
        return replace(segment, sha256=write_weights(path, self._ring.rows(first, count), FORMAT))


class RowsOnDisk:
    """The files of all memories of a stage of training."""

    def __init__(self, folder: Path, known: Mapping[str, RowsInfo], owner: str = "") -> None:
        """Write to a folder that need not be there yet.

        Args:
            folder: the place of the files.
            known: files that hold what is in the memories of the first stage already, by name.
            owner: what names of files begin with, so that several can write to the folder.
        """
        self._folder, self._known, self._owner = folder, known, owner
        self._files: dict[str, RowFiles] = {}

    def open(self, rings: Mapping[str, Ring]) -> None:
        """Write the rows of these memories from now on."""
        if rings:
            self._folder.mkdir(exist_ok=True)
        known, self._known = self._known, {}
        self._files = {
            name: RowFiles(self._folder, self._owner + name, ring, known.get(name))
            for name, ring in rings.items()
        }

    def write_whole_files(self) -> None:
        """Write the rows that fill a file.

        Raises:
            OSError: a file cannot be written; a later call writes it.
        """
        for files in self._files.values():
            files.write_whole_files()

    def write(self, rings: Mapping[str, Ring]) -> dict[str, RowsInfo]:
        """Write all rows that are not written yet, of these memories if none were opened yet.

        Raises:
            OSError: a file cannot be written.
        """
        if not self._files:
            self.open(rings)
        return {name: files.write() for name, files in self._files.items()}


def file_name(name: str, segment: Segment) -> str:
    """The name of a file of the memory ``name``."""
    return f"{name}-{segment.first}-{segment.count}.safetensors"


def read_rows(folder: Path, name: str, ring: Ring, info: RowsInfo) -> None:
    """Fill a memory from its files.

    Raises:
        RunError: a file is missing, damaged, or not what ``info`` says, or rows are missing.
    """
    ring.seen = info.seen
    place, most = ring.seen - ring.held, _rows_of_a_file(ring)
    for segment in info.segments:
        path = folder / file_name(name, segment)
        if segment.first > place or segment.count > most:
            raise RunError(f"{path}: rows {place} to {segment.first} are missing before it")
        limit = segment.count * ring.row_bytes + _HEADER_BYTES
        try:
            rows = tensors_in(read_plain(path, limit), path, FORMAT, segment.sha256)
            ring.put(segment.first, rows)
        except OSError as error:
            raise RunError(f"{path}: cannot be read ({error.strerror})") from error
        except ValueError as error:
            raise RunError(f"{path}: {error}") from error
        place = segment.first + segment.count
    if place != ring.seen:
        raise RunError(f"{folder}: {name}: rows {place} to {ring.seen} are missing")


def files_of(rows: dict[str, RowsInfo]) -> set[str]:
    """Names of all files of a checkpoint."""
    return {file_name(name, one) for name, info in rows.items() for one in info.segments}


def _rows_of_a_file(ring: Ring) -> int:
    return max(1, _SEGMENT_BYTES // ring.row_bytes)
