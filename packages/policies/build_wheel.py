"""Builds the wheel `innerattn-policies`: exported teams in pure Python, with numpy alone.

Its modules are those of the package `innerattn` under another name, taken from python/innerattn
each time. The same sources give the same bytes. It needs Python 3.11 and nothing else.

usage: python packages/policies/build_wheel.py [FOLDER]   (dist/policies)
"""

from __future__ import annotations

import base64
import hashlib
import io
import os
import re
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = "innerattn_policies"
HOMES = {
    "innerattn.policies.exported": PACKAGE,
    "innerattn.config.untrusted": f"{PACKAGE}.untrusted",
    "innerattn.errors": f"{PACKAGE}.errors",
}
"""What modules are called in the wheel; those of a package follow it."""
PYTHON, NUMPY = "3.9", "1.21"
"""The oldest versions that the modules work with."""
_IMPORT = re.compile(r"(?m)^(\s*(?:from|import)\s+)(innerattn\b[\w.]*)")
_BEGINNING = (1980, 1, 1, 0, 0, 0)  # the first time that a zip archive can hold


def sources() -> dict[str, str]:
    """The text of each module of the wheel, by its path there.

    Raises:
        ValueError: a module imports one that is not in the wheel.
    """
    found = {f"{PACKAGE}/py.typed": ""}
    for name, home in HOMES.items():
        path = ROOT.joinpath("python", *name.split("."))
        if path.is_dir():
            for file in sorted(path.glob("*.py")):
                found[f"{home}/{file.name}"] = renamed(file.read_text("utf-8"), file.name)
        else:
            file = path.with_suffix(".py")
            found[f"{home.replace('.', '/')}.py"] = renamed(file.read_text("utf-8"), file.name)
    return found


def renamed(text: str, place: str) -> str:
    """The text of a module with the names of the wheel in its imports.

    Args:
        text: of the module.
        place: what to call it in messages.

    Raises:
        ValueError: it imports a module that is not in the wheel.
    """

    def new_name(found: re.Match[str]) -> str:
        name = found[2]
        for known, home in HOMES.items():
            if name == known or name.startswith(f"{known}."):
                return found[1] + home + name.removeprefix(known)
        raise ValueError(f"{place}: imports {name}, which is not in the wheel")

    return _IMPORT.sub(new_name, text)


def version() -> str:
    """The version of innerattn."""
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))
    found: str = cargo["workspace"]["package"]["version"]
    return found


def metadata() -> str:
    """The file METADATA."""
    lines = [
        "Metadata-Version: 2.4",
        "Name: innerattn-policies",
        f"Version: {version()}",
        "Summary: Runs teams of robots that innerattn exported, with numpy alone",
        "Author: The innerattn developers",
        "License-Expression: MIT",
        "License-File: LICENSE",
        "Classifier: Operating System :: OS Independent",
        "Classifier: Programming Language :: Python :: 3",
        "Classifier: Typing :: Typed",
        f"Requires-Python: >={PYTHON}",
        f"Requires-Dist: numpy>={NUMPY}",
        "Provides-Extra: onnxruntime",
        'Requires-Dist: onnxruntime; extra == "onnxruntime"',
        "Description-Content-Type: text/markdown",
    ]
    page = (Path(__file__).parent / "README.md").read_text("utf-8")
    return "\n".join(lines) + f"\n\n{page}"


def wheel() -> tuple[str, bytes]:
    """The name of the wheel's file, and its bytes.

    Raises:
        ValueError: as of `sources`.
    """
    name = f"{PACKAGE}-{version()}"
    about = f"{name}.dist-info"
    files = sources() | {
        f"{about}/METADATA": metadata(),
        f"{about}/WHEEL": "Wheel-Version: 1.0\nGenerator: innerattn\nRoot-Is-Purelib: true\n"
        "Tag: py3-none-any\n",
        f"{about}/licenses/LICENSE": (ROOT / "LICENSE").read_text("utf-8"),
    }
    rows = [f"{path},{_digest(text)},{len(text.encode())}" for path, text in files.items()]
    record = f"{about}/RECORD"
    files[record] = "\n".join([*rows, f"{record},,"]) + "\n"
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for path, text in files.items():
            entry = zipfile.ZipInfo(path, _BEGINNING)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, text.encode())
    return f"{name}-py3-none-any.whl", data.getvalue()


def _digest(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return "sha256=" + base64.urlsafe_b64encode(digest).decode().rstrip("=")


def write_wheel(folder: Path) -> Path:
    """Write the wheel into a folder, which is made if needed; it appears whole or not at all.

    Raises:
        ValueError: as of `sources`.
        OSError: it cannot be written.
    """
    name, data = wheel()
    folder.mkdir(parents=True, exist_ok=True)
    partial = folder / f".{name}"
    partial.write_bytes(data)
    os.replace(partial, folder / name)
    return folder / name


if __name__ == "__main__":
    path = write_wheel(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist" / "policies")
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
