"""The run folder that is being filled: configuration, a record of how it was made, and weights.

A folder is made whole or not at all.
"""

from __future__ import annotations

import errno
import os
import platform
import subprocess
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from torch import Tensor

from innerattn.config import RunConfig, write_toml
from innerattn.config.files import write_in_place, write_whole
from innerattn.errors import RunError, UnsealedRunWarning
from innerattn.records.logged import METRICS
from innerattn.records.run_files import info_text, seal
from innerattn.records.run_folder import (
    SCHEMA_VERSION,
    RunInfo,
    State,
    read_info,
)
from innerattn.train.orphans import being_made, name_while_made, sweep_orphans
from innerattn.train.saved import (
    Checkpoints,
    Content,
    nothing_was_saved,
    refuse_not_finite,
    whole_checkpoints,
)
from innerattn.train.weights import write_weights

_PACKAGES = ("innerattn", "torch", "numpy")


class RunFolder:
    """A run folder that is being filled."""

    def __init__(self, path: Path, info: RunInfo) -> None:
        """Take over a folder that exists; `create` makes one."""
        self.path = path
        self.info = info

    @classmethod
    def create(
        cls,
        path: Path,
        config: RunConfig,
        threads: int,
        compiled: bool = False,
        matmul_backend: str = "default",
    ) -> RunFolder:
        """Make the folder at ``path``; it appears with its files or not at all.

        What killed processes left beside it, while they made a run folder, is removed.

        Raises:
            RunError: something is at ``path`` already, or the folder cannot be made.
        """
        refuse_existing(path)
        info = _first_info(config, threads, compiled, matmul_backend)
        partial = name_while_made(path)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            sweep_orphans(path.parent)
            with being_made(partial):
                write_toml(config, partial / "config.toml")
                _write_info(partial, info)
                (partial / "checkpoints").mkdir()
                os.rename(partial, path)
        except OSError as error:
            if error.errno in (errno.ENOTEMPTY, errno.EEXIST):  # another training was faster
                refuse_existing(path)
            raise RunError(f"{path}: cannot make the run folder ({error.strerror})") from error
        return cls(path, info)

    @classmethod
    def begin_anew(
        cls, path: Path, config: RunConfig, before: RunInfo, compiled: bool, matmul_backend: str
    ) -> RunFolder:
        """Empty the folder of a run that saved nothing before it was stopped.

        Raises:
            OSError: something cannot be removed or written.
        """
        Checkpoints(path, config.digest(), config.train.keep_checkpoints).clear()
        (path / METRICS).unlink(missing_ok=True)
        info = _first_info(config, before.threads, compiled, matmul_backend)
        info = replace(info, resumed=before.resumed + 1)
        _write_info(path, info)
        return cls(path, info)

    def save_weights(self, tensors: Mapping[str, Tensor], env_steps: int) -> None:
        """Write a checkpoint named after ``env_steps`` and make it the newest one.

        Whatever is raised, the newest checkpoint stays what it was. Its digest is written down with
        the next `mark`.

        Raises:
            RunError: a value is not finite, which means that training has diverged.
            OSError: the files cannot be written.
        """
        refuse_not_finite(tensors, env_steps)
        folder = self.path / "checkpoints" / str(env_steps)
        folder.mkdir(exist_ok=True)
        (folder / "checkpoint.json").unlink(missing_ok=True)  # it spoke of other weights
        digest = write_weights(folder / "weights.safetensors", tensors)
        write_whole(folder.with_name("latest"), f"{env_steps}\n".encode())
        self.info = replace(self.info, weights_sha256=digest)

    def save_checkpoint(self, checkpoints: Checkpoints, content: Content) -> None:
        """Write a checkpoint that a run can go on from, and make it the newest one.

        Raises:
            RunError, OSError: as of `save_weights`.
        """
        self.info = replace(self.info, weights_sha256=checkpoints.save(content))

    def mark(
        self,
        state: State,
        env_steps: int,
        updates: int,
        seconds: float,
        cpu_seconds: float | None = None,
    ) -> None:
        """Write down how far the run has come; at its end, seal it with a manifest.

        Raises:
            OSError: a file cannot be written. Where the run ended, ``run.json`` says so if it can:
                a full disk has room for that, and none for a manifest.
        """
        self.info = replace(
            self.info,
            state=state,
            env_steps=env_steps,
            updates=updates,
            seconds=round(seconds, 3),
            cpu_seconds=self.info.cpu_seconds if cpu_seconds is None else round(cpu_seconds, 3),
            sealed=False,
        )
        if state == "running":
            _write_info(self.path, self.info)
            return
        try:
            self.info = seal(self.path, self.info)
        except OSError:
            with suppress(OSError):  # the first error says more
                write_in_place(self.path / "run.json", info_text(self.info))
            raise


def refuse_existing(path: Path) -> None:
    """Let no run overwrite anything, nor lie where its weights cannot be read.

    Raises:
        RunError: something is at ``path``, or its name is no UTF-8.
    """
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError as error:
        name = ascii(str(path.absolute()))
        raise RunError(f"{name}: is no UTF-8; safetensors needs a path that is") from error
    if not os.path.lexists(path):
        return
    raise RunError(f"{path}: exists already{_what_to_do(path)}")


def _what_to_do(path: Path) -> str:
    """What is at ``path``, where a run should begin, and what to do about it."""
    with suppress(RunError), warnings.catch_warnings():
        warnings.simplefilter("ignore", UnsealedRunWarning)
        info = read_info(path)
        saved = whole_checkpoints(path / "checkpoints")
        if info.state != "done" and (saved or nothing_was_saved(path, info)):
            ended = f"interrupted after {info.env_steps:,} env-steps"
            ended = ended if info.state == "interrupted" else "and is in training or was killed"
            return f", {ended}; go on with: innerattn train --resume {path}"
    return "; choose another run folder or remove it"


def _write_info(folder: Path, info: RunInfo) -> None:
    write_whole(folder / "run.json", info_text(info))


def _first_info(config: RunConfig, threads: int, compiled: bool, matmul_backend: str) -> RunInfo:
    """What ``run.json`` says of a run that begins."""
    return RunInfo(
        schema_version=SCHEMA_VERSION,
        versions=versions(),
        seed=config.train.seed,
        commit=_commit(),
        threads=threads,
        compiled=compiled,
        matmul_backend=matmul_backend,
        device=config.train.device,
        state="running",
        env_steps=0,
        updates=0,
        seconds=0.0,
        warm_start=config.train.warm_start,
    )


def versions() -> dict[str, str]:
    """Versions of what the numbers of a run depend on, by name."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _commit() -> str | None:
    """The commit of the source tree this module is in; none where it is installed or untracked."""
    here = Path(__file__)
    command = ["git", "-C", str(here.parent)]
    quiet = {"capture_output": True, "text": True, "check": True, "timeout": 10}
    try:
        # An installed package may lie inside somebody else's repository.
        subprocess.run([*command, "ls-files", "--error-unmatch", here.name], **quiet)  # type: ignore[call-overload]
        found = subprocess.run([*command, "rev-parse", "HEAD"], **quiet)  # type: ignore[call-overload]
    except (OSError, subprocess.SubprocessError):
        return None
    return str(found.stdout.strip())
