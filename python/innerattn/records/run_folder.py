"""A run folder, read: what was trained, how, how far it came, and where its weights are.

Nothing in a folder is trusted: links and paths that lead out of it are refused, and every file is
checked against the manifest.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from innerattn.config import RunConfig
from innerattn.config.load import config_in
from innerattn.config.untrusted import MOST_TOML_BYTES
from innerattn.errors import RunError
from innerattn.records.run_files import RunFiles
from innerattn.records.run_info import SCHEMA_VERSION, RunInfo, State, run_info

__all__ = [
    "SCHEMA_VERSION",
    "RunInfo",
    "State",
    "config_of",
    "newest_weights",
    "read_config",
    "read_info",
    "run_info",
    "weights_name",
]

_MOST_NAME_BYTES = 64


def read_info(run: str | Path) -> RunInfo:
    """What ``run.json`` says.

    Raises:
        RunError: there is no such folder, it was not made by training, or ``run.json`` is damaged.
    """
    return RunFiles(run).info


def read_config(run: str | Path) -> RunConfig:
    """The configuration of a run.

    Raises:
        RunError: no run folder, none of ours, or its ``config.toml`` is no plain file, or not the
            one that was sealed.
        ConfigError: that is not valid.
    """
    return config_of(RunFiles(run))


def config_of(files: RunFiles) -> RunConfig:
    """The configuration of a run that is being read; raises what `read_config` does."""
    return config_in(files.read("config.toml", MOST_TOML_BYTES), files.path / "config.toml")


def weights_name(files: RunFiles) -> str:
    """The name in the run of the weights that ``checkpoints/latest`` names by a plain number.

    Raises:
        RunError: there are none (yet), or what is there was not made by training.
    """
    checkpoints = files.path / "checkpoints"
    latest = checkpoints / "latest"
    if checkpoints.is_symlink() or not checkpoints.is_dir() or not os.path.lexists(latest):
        raise RunError(f"{files.path}: holds no checkpoint yet")
    try:
        name = files.read("checkpoints/latest", _MOST_NAME_BYTES).decode("ascii").strip()
    except ValueError:
        name = ""
    folder = checkpoints / name
    if not re.fullmatch(r"[0-9]{1,18}", name) or folder.is_symlink() or not folder.is_dir():
        raise RunError(f"{latest}: must name a folder beside it by its number")
    return f"checkpoints/{name}/weights.safetensors"


def newest_weights(run: Path) -> Path:
    """The weights file that ``checkpoints/latest`` names.

    Raises:
        RunError: as of `weights_name`.
    """
    return run / weights_name(RunFiles(run))
