"""What tests of `innerattn reproduce` look at in a study of small runs."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from innerattn.train.weights import read_weights

Command = Callable[..., int]
"""The command with small runs, as the fixture ``command`` has it."""
NAMES = ("mixed-td-inner-quick-s0", "mixed-td-uniform-quick-s0")
"""Folders of the runs of the fixture ``study``."""


def account(out: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((out / "runs.json").read_text())
    return document


def states(out: Path) -> list[str]:
    return [run["state"] for run in account(out)["runs"]]


def weights(folder: Path) -> dict[str, bytes]:
    tensors = read_weights(folder / "checkpoints" / "96" / "weights.safetensors")
    return {name: tensor.numpy().tobytes() for name, tensor in tensors.items()}


def times(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in (folder, *folder.rglob("*"))}
