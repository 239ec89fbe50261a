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
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from innerattn.config.files import write_whole
from innerattn.config.untrusted import parse_json, read_plain
from innerattn.errors import RunError

FORMAT = "innerattn.weights"
SCHEMA_VERSION = "1"
MOST_BYTES = 4 << 30
"""Longest file that is read."""
_MOST_HEADER_BYTES = 8 << 20
_MOST_TENSORS = 20_000


def write_weights(path: Path, tensors: Mapping[str, Tensor], form: str = FORMAT) -> str:
    """Write named tensors to ``path``; the file appears whole or not at all.

    Args:
        path: the file.
        tensors: by name.
        form: what the file says that it is.

    Returns:
        Their digest, see `digest_of`.

    Raises:
        OSError: the file cannot be written.
    """
    plain = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    digest = _digest(plain)
    metadata = {"format": form, "schema_version": SCHEMA_VERSION, "sha256": digest}
    write_whole(path, _in_order(save(plain, metadata)))
    return digest


def _in_order(data: bytes) -> bytes:
    """The same file with its metadata in one order; `save` writes them in a new one each time."""
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, ensure_ascii=False, separators=(",", ":")).encode()
    text = text.ljust(-(-len(text) // 8) * 8)  # tensors begin at a multiple of 8 bytes
    return b"".join((len(text).to_bytes(8, "little"), text, memoryview(data)[8 + size :]))


def read_weights(path: Path) -> dict[str, Tensor]:
    """The named tensors in ``path``, on the CPU.

    Raises:
        RunError: the file is missing, a link, truncated, altered, of another format or of another
            version, or too large; the message names the file.
    """
    return _read(path)[0]


def digest_of(path: Path) -> str:
    """SHA-256 of the tensors in ``path``, in hexadecimal.

    It is that of names, dtypes, shapes and bytes: the same training gives the same one.

    Raises:
        RunError: as of `read_weights`.
    """
    return _read(path)[1]


def weights_in(data: bytes, path: Path, sha256: str | None = None) -> dict[str, Tensor]:
    """The named tensors of a policy in the bytes of the file at ``path``.

    Args:
        data: the file.
        path: where it lies.
        sha256: the digest that they must have, as of `digest_of`; None: any.

    Raises:
        RunError: as of `read_weights`; or they are others, or hold a value that is not finite.
    """
    tensors, digest = _parse(data, path, FORMAT)
    if sha256 not in (None, digest):
        raise RunError(f"{path}: is not of this run: run.json names other weights")
    _refuse_not_finite(tensors, path)
    return tensors


def tensors_in(data: bytes, path: Path, form: str, sha256: str) -> dict[str, Tensor]:
    """The named tensors of a checkpoint in the bytes of the file at ``path``.

    Raises:
        RunError: as of `weights_in`, or the file does not say that it is of ``form``.
    """
    tensors, digest = _parse(data, path, form)
    if sha256 != digest:
        raise RunError(f"{path}: is not of this checkpoint: checkpoint.json names another one")
    _refuse_not_finite(tensors, path)
    return tensors


def _refuse_not_finite(tensors: Mapping[str, Tensor], path: Path) -> None:
    for name, tensor in tensors.items():
        if not bool(tensor.isfinite().all()):
            raise RunError(f"{path}: a value of {name} is not finite")


def _read(path: Path) -> tuple[dict[str, Tensor], str]:
    """Tensors and their digest."""
    try:
        data = read_plain(path, MOST_BYTES)
    except OSError as error:
        raise RunError(f"{path}: cannot be read ({error.strerror})") from error
    return _parse(data, path, FORMAT)


def _parse(data: bytes, path: Path, form: str) -> tuple[dict[str, Tensor], str]:
    try:
        metadata = _metadata(data)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: not readable as safetensors ({error})") from error
    if metadata.get("format") != form:
        raise RunError(f"{path}: not a file of {form}")
    if metadata.get("schema_version") != SCHEMA_VERSION:
        found = metadata.get("schema_version")
        raise RunError(f"{path}: schema version {found}, only {SCHEMA_VERSION} is known")
    try:
        tensors = load(data)
    except (SafetensorError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: not readable as safetensors ({error})") from error
    digest = _digest(tensors)
    if metadata.get("sha256") != digest:
        raise RunError(f"{path}: contents do not match their digest; the file was altered")
    return tensors, digest


def _metadata(data: bytes) -> dict[str, str]:
    """What a safetensors file says of itself, from a header of a bearable size.

    Raises:
        ValueError: the header is not of that form, or names too many tensors.
    """
    length = int.from_bytes(data[:8], "little")
    if len(data) < 8 or length > min(len(data) - 8, _MOST_HEADER_BYTES):
        raise ValueError(f"a header of {length} bytes: must be whole, at most {_MOST_HEADER_BYTES}")
    # Each tensor has one pair of offsets: counted before anything is made of them.
    count = data.count(b"data_offsets", 8, 8 + length)
    if count > _MOST_TENSORS:
        raise ValueError(f"{count} tensors: must be at most {_MOST_TENSORS}")
    header = parse_json(data[8 : 8 + length])
    metadata: dict[str, str] = header.get("__metadata__", {})
    if not isinstance(metadata, dict):
        raise ValueError("metadata is no object")
    return metadata


def _digest(tensors: Mapping[str, Tensor]) -> str:
    """SHA-256 of names, dtypes, shapes and bytes, in the order of names."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        head = json.dumps([name, str(tensor.dtype), list(tensor.shape)])
        digest.update(head.encode())
        digest.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
