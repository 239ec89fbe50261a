"""The checkpoints of a run, each in a folder of its own: written whole or not at all, and dropped.

A folder ``checkpoints/N`` with a ``checkpoint.json`` is whole. It appears by one renaming, after
all that it names has reached the disk; only then do older ones go.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from innerattn.config.files import sync_folder, write_whole
from innerattn.errors import RunError
from innerattn.records.run_folder import RunInfo
from innerattn.train.checkpoint_info import (
    SCHEMA_VERSION,
    Best,
    CheckpointInfo,
    Counters,
    RowsInfo,
    checkpoint_info,
    checkpoint_text,
)
from innerattn.train.metrics import MetricsFile
from innerattn.train.row_files import files_of
from innerattn.train.weights import write_weights

STATE_FORMAT = "innerattn.state"
INFO = "checkpoint.json"
_PARTIAL = re.compile(r"\..+\.[0-9a-f]{16}")
"""Names of what is being written, see `innerattn.config.files.write_whole`."""


@dataclass(frozen=True)
class Content:
    """What a checkpoint holds.

    Attributes:
        counters: how far the run is.
        weights: everything learnt, by name.
        state: everything else but the large memories, by name.
        rows: the files of the large memories by name; they are written already.
        metrics: the lines so far.
        best: the weights that `Counters.best` speaks of, unless they are saved already.
    """

    counters: Counters
    weights: Mapping[str, Tensor]
    state: Mapping[str, Tensor]
    rows: Mapping[str, RowsInfo]
    metrics: MetricsFile
    best: Mapping[str, Tensor] | None


class Checkpoints:
    """The folder ``checkpoints`` of a run that is being trained."""

    def __init__(self, run: Path, config_sha256: str, keep: int) -> None:
        """Write to a run folder that is there; the newest ``keep`` checkpoints stay."""
        self.folder = run / "checkpoints"
        self.rows = self.folder / "rows"
        self._config_sha256, self._keep = config_sha256, keep

    def save(self, content: Content) -> str:
        """Write a checkpoint, then drop older ones.

        Whatever is raised, the older ones are as they were.

        Returns:
            The digest of its weights.

        Raises:
            RunError: a value is not finite, which means that training has diverged.
            OSError: a file cannot be written.
        """
        counters = content.counters
        for tensors in (content.weights, content.state):
            refuse_not_finite(tensors, counters.env_steps)
        content.metrics.sync()
        self.save_best(counters.best, content.best)
        target = self.folder / str(counters.env_steps)
        if (target / INFO).is_file():  # of the midst of the same control step
            return checkpoint_info((target / INFO).read_bytes()).weights_sha256
        partial = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
        partial.mkdir()
        try:
            info = CheckpointInfo(
                schema_version=SCHEMA_VERSION,
                config_sha256=self._config_sha256,
                counters=counters,
                weights_sha256=write_weights(partial / "weights.safetensors", content.weights),
                state_sha256=write_weights(
                    partial / "state.safetensors", content.state, STATE_FORMAT
                ),
                rows=dict(content.rows),
                metrics_bytes=content.metrics.bytes,
                metrics_sha256=content.metrics.sha256,
            )
            write_whole(partial / INFO, checkpoint_text(info))
            if self.rows.is_dir():
                sync_folder(self.rows)
            _drop_folder(target)  # weights alone, such as a former version saved
            os.rename(partial, target)
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
        sync_folder(self.folder)
        self.name_latest(counters.env_steps)
        self._drop(whole_checkpoints(self.folder)[-self._keep :])
        return info.weights_sha256

    def save_best(self, best: Best | None, weights: Mapping[str, Tensor] | None) -> None:
        """Write the best weights so far, if they are not written yet.

        Raises:
            OSError: the file cannot be written.
        """
        if best is not None and weights is not None:
            path = self.folder / best_name(best)
            if not path.exists():
                write_weights(path, weights)

    def name_latest(self, number: int) -> None:
        """Make a checkpoint the newest one.

        Raises:
            OSError: the file cannot be written.
        """
        write_whole(self.folder / "latest", f"{number}\n".encode())

    def sweep(self, newest: int) -> None:
        """Remove what a process that was killed left behind, and all that came after ``newest``.

        Raises:
            OSError: something cannot be removed.
        """
        for place in (self.folder, self.rows, self.folder.parent):
            _remove(entry for entry in _entries(place) if _PARTIAL.fullmatch(entry.name))
        for entry in _entries(self.folder):
            if entry.name.isdigit() and int(entry.name) > newest:
                _drop_folder(entry)
        self.name_latest(newest)
        self._drop(whole_checkpoints(self.folder))

    def clear(self) -> None:
        """Remove what a process left behind that was killed before its first checkpoint.

        Raises:
            OSError: something cannot be removed.
        """
        _remove(_entries(self.folder))
        run = self.folder.parent
        _remove(entry for entry in _entries(run) if _PARTIAL.fullmatch(entry.name))

    def keep_last_weights_only(self, number: int, best: Best | None) -> None:
        """Remove all that a run needs to go on, once it is done.

        Raises:
            OSError: something cannot be removed.
        """
        kept = {str(number), "latest"} | (set() if best is None else {best_name(best)})
        for entry in _entries(self.folder):
            if entry.name not in kept:
                _drop_folder(entry) if _is_folder(entry) else entry.unlink()
        _remove(self.folder / str(number) / name for name in (INFO, "state.safetensors"))

    def _drop(self, kept: Iterable[int]) -> None:
        """Remove all checkpoints but those ``kept``, and the files that only they need."""
        folders, rows, bests = set(), set(), set()
        for number in kept:
            try:
                info = checkpoint_info((self.folder / str(number) / INFO).read_bytes())
            except ValueError:  # damaged, and of no use to anybody
                continue
            folders.add(str(number))
            rows |= files_of(info.rows)
            bests |= set() if info.counters.best is None else {best_name(info.counters.best)}
        for entry in _entries(self.folder):
            if entry.name.isdigit() and entry.name not in folders:
                _drop_folder(entry)
            elif entry.name.startswith("best-") and entry.name not in bests:
                entry.unlink()
        _remove(entry for entry in _entries(self.rows) if entry.name not in rows)


def best_name(best: Best) -> str:
    """The name of the file with the best weights."""
    return f"best-{best.env_steps}.safetensors"


def whole_checkpoints(folder: Path) -> list[int]:
    """Numbers of the checkpoints in a folder ``checkpoints`` that a run can go on from, sorted."""
    numbers = (entry for entry in _entries(folder) if entry.name.isdigit())
    return sorted(int(entry.name) for entry in numbers if (entry / INFO).is_file())


def nothing_was_saved(run: Path, info: RunInfo) -> bool:
    """Whether a training was stopped before it saved anything: it can begin anew in its folder."""
    latest = run / "checkpoints" / "latest"
    return info.state != "done" and info.weights_sha256 is None and not os.path.lexists(latest)


def refuse_not_finite(tensors: Mapping[str, Tensor], env_steps: int) -> None:
    """Refuse to save what has diverged.

    Raises:
        RunError: a value is not finite; the message names the tensor.
    """
    for name, tensor in tensors.items():
        finite = tensor.isfinite()
        if not bool(finite.all()):
            value = float(tensor[~finite].flatten()[0])
            raise RunError(
                f"training diverged at env_steps = {env_steps}: a value of {name} is "
                f"{value}: must be finite; these weights are not saved"
            )


def _entries(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if _is_folder(folder) else []


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _drop_folder(folder: Path) -> None:
    """Remove a folder; what is left of it if that is cut short is no checkpoint."""
    if _is_folder(folder):
        (folder / INFO).unlink(missing_ok=True)
        shutil.rmtree(folder)


def _remove(paths: Iterable[Path]) -> None:
    for path in list(paths):
        if _is_folder(path):
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
