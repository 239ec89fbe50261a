"""The run folder: configuration, a record of how it was made, and weights; made, filled and read.

A folder is made whole or not at all, and nothing in it is trusted when it is read: links and
paths that lead out of it are refused, and no file is unpickled.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from torch import Tensor

from innerattn.config import RunConfig, write_toml
from innerattn.config.files import write_whole
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.learn.types import Learner
from innerattn.records.run_files import RunFiles, info_text, seal
from innerattn.records.run_folder import SCHEMA_VERSION, RunInfo, State, config_of, weights_name
from innerattn.train.build import build_learner
from innerattn.train.weights import MOST_BYTES, digest_of, weights_in, write_weights

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

        Raises:
            RunError: something is at ``path`` already, or the folder cannot be made.
        """
        refuse_existing(path)
        info = RunInfo(
            schema_version=SCHEMA_VERSION,
            versions=_versions(),
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
        partial = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            partial.mkdir()
            write_toml(config, partial / "config.toml")
            _write_info(partial, info)
            (partial / "checkpoints").mkdir()
            os.rename(partial, path)
        except OSError as error:
            shutil.rmtree(partial, ignore_errors=True)
            raise RunError(f"{path}: cannot make the run folder ({error.strerror})") from error
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
        return cls(path, info)

    def save_weights(self, tensors: Mapping[str, Tensor], env_steps: int) -> None:
        """Write a checkpoint named after ``env_steps`` and make it the newest one.

        Whatever is raised, the newest checkpoint stays what it was. Its digest is written down with
        the next `mark`.

        Raises:
            RunError: a value is not finite, which means that training has diverged.
            OSError: the files cannot be written.
        """
        for name, tensor in tensors.items():
            if not bool(tensor.isfinite().all()):
                raise RunError(
                    f"training diverged at env_steps = {env_steps}: a value of {name} is "
                    f"{_not_finite(tensor)}: must be finite; these weights are not saved"
                )
        folder = self.path / "checkpoints" / str(env_steps)
        folder.mkdir(exist_ok=True)
        weights = folder / "weights.safetensors"
        write_weights(weights, tensors)
        write_whole(folder.with_name("latest"), f"{env_steps}\n".encode())
        self.info = replace(self.info, weights_sha256=digest_of(weights))

    def mark(self, state: State, env_steps: int, updates: int, seconds: float) -> None:
        """Write down how far the run has come; at its end, seal it with a manifest."""
        self.info = replace(
            self.info,
            state=state,
            env_steps=env_steps,
            updates=updates,
            seconds=round(seconds, 3),
            sealed=False,
        )
        if state == "running":
            _write_info(self.path, self.info)
        else:
            self.info = seal(self.path, self.info)


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
    if os.path.lexists(path):
        raise RunError(f"{path}: exists already; choose another run folder or remove it")


def load_policy(run: str | Path, device: str = "cpu") -> tuple[RunConfig, Learner]:
    """The configuration of a run and a learner with its newest weights.

    Args:
        run: the run folder.
        device: where the networks are put; the device of training need not exist here.

    Raises:
        RunError: no run folder, none of ours, no checkpoint yet, or weights that are truncated,
            altered or of other networks.
        ConfigError: its ``config.toml`` is not valid.
    """
    path = Path(run)
    files = RunFiles(path)
    config = config_of(files)
    train = config.train.model_copy(update={"device": device})
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        learner = build_learner(config.model_copy(update={"train": train}), env)
    name = weights_name(files)
    weights = path / name
    known = files.info.weights_sha256 if files.info.state != "running" else None
    tensors = weights_in(files.read(name, MOST_BYTES), weights, known)
    try:
        learner.load(tensors)
    except ValueError as error:
        raise RunError(f"{weights}: {error}") from error
    return config, learner


def _write_info(folder: Path, info: RunInfo) -> None:
    write_whole(folder / "run.json", info_text(info))


def _not_finite(tensor: Tensor) -> float:
    return float(tensor[~tensor.isfinite()].flatten()[0])


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    return versions


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
