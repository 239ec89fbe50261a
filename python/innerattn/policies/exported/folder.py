"""The folder of an exported team: read once, each file checked against its SHA-256."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from innerattn.config.untrusted import read_plain
from innerattn.errors import ExportError, RunError
from innerattn.policies.exported.contract import NAME, Contract, contract_in

_MOST_BYTES = 1 << 30
_MOST_CONTRACT_BYTES = 8 << 20


@dataclass(frozen=True)
class ExportFolder:
    """What lies in a folder: the contract, and the bytes of the files that it names."""

    path: Path
    contract: Contract
    files: dict[str, bytes]


def read_export(folder: str | Path) -> ExportFolder:
    """Read an exported team.

    Raises:
        ExportError: there is no such folder, a file is missing, altered or of another export.
    """
    path = Path(folder)
    if not path.is_dir():
        raise ExportError(f"{path}: no such folder of an exported team")
    try:
        contract = contract_in(_read(path / NAME, _MOST_CONTRACT_BYTES))
    except ValueError as error:
        raise ExportError(f"{path / NAME}: {error}") from error
    files = {}
    for name, entry in contract.files.items():
        data = _read(path / name, _MOST_BYTES)
        if (hashlib.sha256(data).hexdigest(), len(data)) != (entry.sha256, entry.bytes):
            raise ExportError(
                f"{path / name}: is not the file that {NAME} names by its SHA-256; it was altered "
                "or is of another team"
            )
        files[name] = data
    return ExportFolder(path, contract, files)


def _read(file: Path, most_bytes: int) -> bytes:
    try:
        return read_plain(file, most_bytes)
    except RunError as error:
        raise ExportError(str(error)) from error
    except OSError as error:
        raise ExportError(f"{file}: cannot be read ({error.strerror})") from error
