"""Tensors in a safetensors file with a name, a version and a digest; nothing is unpickled.

A file that is truncated, altered or made by something else is refused before any tensor is used.
What the tensors mean is the learner's business.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from innerattn.config.files import write_whole
from innerattn.errors import RunError

FORMAT = "innerattn.weights"
SCHEMA_VERSION = "1"


def write_weights(path: Path, tensors: Mapping[str, Tensor]) -> None:
    """Write named tensors to ``path``; the file appears whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    plain = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    metadata = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "sha256": _digest(plain),
    }
    write_whole(path, save(plain, metadata))


def read_weights(path: Path) -> dict[str, Tensor]:
    """The named tensors in ``path``, on the CPU.

    Raises:
        RunError: the file is missing, a link, truncated, altered, of another format or of another
            version; the message names the file.
    """
    return _read(path)[0]


def digest_of(path: Path) -> str:
    """SHA-256 of the tensors in ``path``, in hexadecimal.

    It is that of names, dtypes, shapes and bytes: the same training gives the same one, while the
    file may differ in the order of its header.

    Raises:
        RunError: as of `read_weights`.
    """
    return _read(path)[1]


def _read(path: Path) -> tuple[dict[str, Tensor], str]:
    """Tensors and their digest."""
    if path.is_symlink() or not path.is_file():
        raise RunError(f"{path}: no weights here (a plain file is needed)")
    try:
        with safe_open(path, framework="pt", device="cpu") as file:
            metadata = file.metadata() or {}
            if metadata.get("format") != FORMAT:
                raise RunError(f"{path}: not a file of {FORMAT}")
            if metadata.get("schema_version") != SCHEMA_VERSION:
                found = metadata.get("schema_version")
                raise RunError(f"{path}: schema version {found}, only {SCHEMA_VERSION} is known")
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: not readable as safetensors ({error})") from error
    digest = _digest(tensors)
    if metadata.get("sha256") != digest:
        raise RunError(f"{path}: contents do not match their digest; the file was altered")
    return tensors, digest


def _digest(tensors: Mapping[str, Tensor]) -> str:
    """SHA-256 of names, dtypes, shapes and bytes, in the order of names."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        head = json.dumps([name, str(tensor.dtype), list(tensor.shape)])
        digest.update(head.encode())
        digest.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
