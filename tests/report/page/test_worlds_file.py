"""The compiled worlds that pages hold are those of the sources beside them."""

import hashlib
import importlib.util
import json
import shutil
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[3]
OLD = "worlds.wasm is out of date: make wasm"


def sources() -> Any:
    """The script that `make wasm` runs."""
    spec = importlib.util.spec_from_file_location("sources", ROOT / "rust_env/wasm/sources.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_worlds_of_pages_are_up_to_date() -> None:
    found = sources()
    record = json.loads(found.RECORD.read_text("utf-8"))
    assert record["sources_sha256"] == found.sources_digest(), OLD
    assert record["wasm_sha256"] == hashlib.sha256(found.WASM.read_bytes()).hexdigest(), OLD


def test_any_change_of_a_source_counts_and_line_endings_do_not(tmp_path: Path) -> None:
    found = sources()
    for name in ("Cargo.lock", "Cargo.toml", "rust_env/Cargo.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    for folder in ("rust_env/src", "rust_env/pool", "rust_env/wasm"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    first = found.sources_digest(tmp_path)
    assert first == found.sources_digest()
    for file in tmp_path.rglob("*.rs"):
        file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    assert found.sources_digest(tmp_path) == first
    changed = {first}
    for name in ("Cargo.lock", "rust_env/pool/Cargo.toml", "rust_env/src/world/victims.rs"):
        with (tmp_path / name).open("a") as file:
            file.write("\n")
        changed.add(found.sources_digest(tmp_path))
    shutil.move(tmp_path / "rust_env/src/rays.rs", tmp_path / "rust_env/src/ray.rs")
    changed.add(found.sources_digest(tmp_path))
    assert len(changed) == 5
