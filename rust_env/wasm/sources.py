"""The digest of all that the worlds of pages are compiled from; `make wasm` writes it beside them.

It depends on neither line endings nor the order of files.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
WASM = ROOT / "python/innerattn/report/page/worlds.wasm"
RECORD = WASM.with_suffix(".json")
FLAGS = "--locked --profile page --target wasm32-unknown-unknown -Zbuild-std=std,panic_abort"
_FOLDERS = ("rust_env/src", "rust_env/pool", "rust_env/wasm")


def sources_digest(root: Path = ROOT) -> str:
    """SHA-256, in hexadecimal, of the names and texts of the Rust sources, and of `FLAGS`."""
    files = [root / "Cargo.lock", root / "Cargo.toml", root / "rust_env/Cargo.toml"]
    for folder in _FOLDERS:
        files += (root / folder).rglob("*.rs")
        files += (root / folder).rglob("Cargo.toml")
    texts = {
        file.relative_to(root).as_posix(): file.read_bytes().replace(b"\r\n", b"\n")
        for file in files
    }
    digest = hashlib.sha256(FLAGS.encode())
    for name, text in sorted(texts.items()):
        digest.update(f"\n{name} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def write_record() -> None:
    """Write beside the compiled worlds what they are, and what they were made from."""
    made = {
        "sources_sha256": sources_digest(),
        "wasm_sha256": hashlib.sha256(WASM.read_bytes()).hexdigest(),
    }
    RECORD.write_text(json.dumps(made, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    if sys.argv[1:] == ["--flags"]:
        print(FLAGS)
    else:
        write_record()
