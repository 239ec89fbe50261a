"""A run folder, read: what was trained, how, how far it came, and where its weights are.

Nothing in a folder is trusted: links and paths that lead out of it are refused.
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from innerattn.config import RunConfig, read_toml
from innerattn.errors import RunError

SCHEMA_VERSION = 1
State = Literal["running", "done", "interrupted"]


@dataclass(frozen=True)
class RunInfo:
    """How a run was made and how far it came; the contents of ``run.json``.

    ``weights_sha256`` is the digest of its newest weights, see `innerattn.train.weights.digest_of`;
    runs made before it was written down have none.
    """

    schema_version: int
    versions: dict[str, str]
    seed: int
    commit: str | None
    threads: int
    device: str
    state: State
    env_steps: int
    updates: int
    seconds: float
    compiled: bool = False
    matmul_backend: str = "default"
    warm_start: str = "none"
    weights_sha256: str | None = None


_FORMER_KEYS = {"products": "matmul_backend"}
"""Keys of a ``run.json`` by the names that they had in older ones."""


def run_info(document: Any) -> RunInfo:
    """What the document of a ``run.json`` says.

    Raises:
        ValueError: it is not the record of a run, or of another version.
    """
    try:
        renamed = {_FORMER_KEYS.get(key, key): value for key, value in document.items()}
        info = RunInfo(**renamed)
    except (TypeError, AttributeError) as error:
        raise ValueError("not the record of a run") from error
    if info.schema_version != SCHEMA_VERSION:
        raise ValueError(f"schema version {info.schema_version}, only {SCHEMA_VERSION} is known")
    if info.state not in get_args(State):
        raise ValueError(f"state {info.state!r} is not one of {get_args(State)}")
    return info


def read_info(run: str | Path) -> RunInfo:
    """What ``run.json`` says.

    Raises:
        RunError: there is no such folder, or it was not made by training.
    """
    path = Path(run)
    if not path.is_dir():
        raise RunError(f"{path}: no such run folder")
    file = path / "run.json"
    try:
        document = json.loads(plain_file(file).read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise RunError(f"{file}: not the record of a run") from error
    try:
        return run_info(document)
    except ValueError as error:
        raise RunError(f"{file}: {error}") from error


def read_config(run: str | Path) -> RunConfig:
    """The configuration of a run.

    Raises:
        RunError: no run folder, none of ours, or its ``config.toml`` is no plain file.
        ConfigError: that is not valid.
    """
    path = Path(run)
    read_info(path)
    return read_toml(plain_file(path / "config.toml"))


def newest_weights(run: Path) -> Path:
    """The weights file that ``checkpoints/latest`` names; a name is a plain number.

    Raises:
        RunError: there is none (yet), or what is there was not made by training.
    """
    checkpoints = run / "checkpoints"
    latest = checkpoints / "latest"
    if checkpoints.is_symlink() or not checkpoints.is_dir() or not os.path.lexists(latest):
        raise RunError(f"{run}: holds no checkpoint yet")
    try:
        name = plain_file(latest).read_text("ascii").strip()
    except ValueError:
        name = ""
    folder = checkpoints / name
    if not re.fullmatch(r"[0-9]{1,18}", name) or folder.is_symlink() or not folder.is_dir():
        raise RunError(f"{latest}: must name a folder beside it by its number")
    return folder / "weights.safetensors"


def plain_file(path: Path) -> Path:
    """``path``, which is a file and no link.

    Raises:
        RunError: it is not.
    """
    if path.is_symlink() or not path.is_file():
        raise RunError(f"{path}: missing, or not a plain file")
    return path
